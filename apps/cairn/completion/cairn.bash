# SPDX-License-Identifier: BSD-3-Clause
# Completion of cairn for bash: what may come next, the program says itself (cairn help complete).

_cairn() {
  local line=${COMP_LINE:0:COMP_POINT} program=${1/#\~/$HOME}
  local words breaks typed before='' entry word files=''
  read -ra words <<<"$line"
  [[ $line != *[[:blank:]] ]] || words+=('')
  typed=${words[-1]}
  # bash replaces only what stands after the last character that separates words for it.
  breaks=${COMP_WORDBREAKS//[^=:@]/}
  [[ -z $breaks ]] || before=${typed%"${typed##*["$breaks"]}"}

  COMPREPLY=()
  while IFS= read -r entry; do
    word=${entry%%$'\t'*}
    if [[ -n $word ]]; then
      COMPREPLY+=("${word#"$before"}")
    else
      files=yes
    fi
  done < <("$program" complete -- "${words[@]:1}" 2>/dev/null)
  if [[ ${COMPREPLY[0]-} == *[:=,] ]]; then
    compopt -o nospace 2>/dev/null
  fi
  if [[ -n $files ]]; then
    while IFS= read -r entry; do
      COMPREPLY+=("$entry")
    done < <(compgen -f -- "${typed#"$before"}")
    compopt -o filenames 2>/dev/null
  fi
  return 0
}
complete -F _cairn cairn
