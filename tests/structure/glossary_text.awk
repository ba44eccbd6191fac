# SPDX-License-Identifier: BSD-3-Clause
# Prints what a reader reads of one file, on the lines where it stands; everything else becomes an empty line.
#   kind=prose     Markdown without fenced and indented blocks, link targets and HTML comments
#   kind=source    string literals (but the paths of #include)
#   kind=header    string literals and comments
# Code in backticks is left out of all of them.
# So that a term is found across a line break, each line ends with the first two words of the next.

function print_line(text) {
  if (NR > 1) {
    next_line = text
    sub(/^ *\/+ */, "", next_line)  # of a comment that goes on
    if (next_line ~ /^</) next_line = ""  # it describes another member
    split(next_line, words, " ")
    print previous ~ /[a-z]/ ? previous " " words[1] " " words[2] : previous
  }
  previous = text
}

# The prose of one line of Markdown.
function prose(text) {
  if (text ~ /^ *```/) {
    fenced = !fenced
    return ""
  }
  if (fenced || text ~ /^    / && text !~ /^ *[-*0-9]/ && !in_list) return ""
  if (text ~ /^ *([-*]|[0-9]+\.) /) in_list = 1
  if (text ~ /^[^ ]/ && text !~ /^([-*]|[0-9]+\.) /) in_list = 0
  gsub(/\]\([^)]*\)/, "]", text)
  gsub(/<!--[^>]*-->/, "", text)
  return text
}

# The literals of one line of C++, and its comments if wanted, with a bar between one and the next.
function cpp(text, with_comments,   out, at, character) {
  if (text ~ /^ *#include/) return ""
  out = ""
  for (at = 1; at <= length(text); ++at) {
    character = substr(text, at, 1)
    if (in_comment) {
      if (substr(text, at, 2) == "*/") { in_comment = 0; ++at }
      else if (with_comments) out = out character
    } else if (raw) {
      if (substr(text, at, 2) == ")\"") { raw = 0; ++at; out = out "|" }
      else out = out character
    } else if (in_string) {
      if (character == "\\") { out = out " "; ++at }
      else if (character == "\"") { in_string = 0; out = out "|" }
      else out = out character
    } else if (substr(text, at, 3) == "R\"(") { raw = 1; at += 2 }
    else if (character == "\"") in_string = 1
    else if (character == "'" && substr(text, at) ~ /^'(\\.|[^\\'])'/) at += substr(text, at + 1, 1) == "\\" ? 3 : 2
    else if (substr(text, at, 2) == "/*") { in_comment = 1; ++at }
    else if (substr(text, at, 2) == "//") return out (with_comments ? substr(text, at + 2) : "")
  }
  in_string = 0
  return out
}

function without_code(text) {
  gsub(/`[^`]*`/, "", text)
  return text
}

{ print_line(without_code(kind == "prose" ? prose($0) : cpp($0, kind == "header"))) }

END { if (NR) print previous }
