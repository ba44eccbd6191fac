#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A front end for compact pose SLAM, as short as one can be: plays a recorded pose graph to
`cairn online --policy` as a robot would drive it.

    python3 live_front_end.py my.g2o -o compact.g2o --policy compact_pose:range=5,angle=0.5

A real front end is the same but for two functions: `way` brings the poses that a robot's odometry
gives, and `match` compares what was sensed at two of them (scans, images), guided by where cairn
expects the one to lie as seen from the other. Here both look into the recording. The protocol is
in docs/online.md; nothing but Python's standard library is needed.
"""
import argparse
import subprocess
import sys


class Recording:
    """A g2o file with poses (VERTEX_SE2, VERTEX_SE3:QUAT), motions between them, and absolute
    measurements of them (EDGE_PRIOR_SE2, EDGE_PRIOR_SE3:QUAT)."""

    def __init__(self, file):
        self.poses, self.fixed, self.measured, self.priors = {}, set(), {}, {}
        with open(file, encoding="utf-8") as lines:
            for line in lines:
                words = line.split()
                if line.startswith("VERTEX"):
                    self.poses[int(words[1])] = line
                elif line.startswith("EDGE_PRIOR"):
                    self.priors.setdefault(int(words[1]), []).append(line)
                elif line.startswith("EDGE"):
                    pair = frozenset((int(words[1]), int(words[2])))
                    self.measured.setdefault(pair, []).append(line)
                elif line.startswith("FIX"):
                    self.fixed.update(map(int, words[1:]))

    def way(self):
        """Each pose with the lines that bring it: itself, and its motion from the one before."""
        before = None
        for pose in sorted(self.poses):
            lines = [self.poses[pose]]
            if pose in self.fixed:
                lines.append(f"FIX {pose}\n")
            yield pose, lines + self.match(before, pose)
            before = pose

    def match(self, earlier, later):
        """The lines with the measured relative pose of two poses; none if they do not match."""
        return self.measured.get(frozenset((earlier, later)), [])


class Cairn:
    """The program, and a conversation with it."""

    def __init__(self, command):
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def tell(self, lines):
        """Lines of data: they are not answered."""
        self.process.stdin.writelines(lines)

    def ask(self, command):
        """A command, and the words of each line of its answer."""
        self.process.stdin.write(command + "\n")
        self.process.stdin.flush()
        answer = []
        for line in self.process.stdout:
            if line.startswith("ERROR"):
                sys.exit(f"cairn: {line.strip()}")
            if line.startswith("OK"):
                return answer
            answer.append(line.split())
        sys.exit("cairn has ended, and did not answer " + command)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("graph", help="a recorded pose graph (g2o)")
    parser.add_argument("-o", "--output", required=True, help="where the compact graph goes")
    parser.add_argument("--policy", default="compact_pose", help="the pose policy, with its options")
    parser.add_argument("--cairn", default="cairn", help="the program")
    options = parser.parse_args()

    recording = Recording(options.graph)
    cairn = Cairn([options.cairn, "online", "--quiet", "--policy", options.policy,
                   "-o", options.output])
    asked = linked = 0
    kept = set()
    for pose, lines in recording.way():
        cairn.tell(lines)
        while True:
            answer = cairn.ask("NEXT")
            linked += sum(words[0] == "LINKED" for words in answer)
            match = answer[-1]  # MATCH earlier later gain, where that is expected, how surely
            if match[1] == "NONE":
                break
            asked += 1
            measured = recording.match(int(match[1]), int(match[2]))
            cairn.tell(measured or [f"NOMATCH {match[1]} {match[2]}\n"])
        cairn.tell(recording.priors.get(pose, []))
        for words in cairn.ask("DONE"):
            linked += words[0] == "LINKED"
            if words[0] == "KEPT":
                kept.add(pose)
    kept.update(int(words[1]) for words in cairn.ask("QUIT") if words[0] == "KEPT")
    cairn.process.stdin.close()
    code = cairn.process.wait()
    print(f"{len(kept)} of {len(recording.poses)} poses kept, {linked} loop closures of {asked} "
          "pairs that were looked at")
    return code


if __name__ == "__main__":
    sys.exit(main())
