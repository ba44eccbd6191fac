# SPDX-License-Identifier: BSD-3-Clause
"""Ctrl-C, as it arrives in a process of its own."""
import signal
import subprocess
import sys
import textwrap

PREAMBLE = """
    import os, signal
    import cairn
    graph, _ = cairn.generate("manhattan", seed=1, poses=1000)

    def press(iteration):
        # By the process itself, so that it comes in time; the handler that C++ sees is the same.
        if iteration.number == 3:
            os.kill(os.getpid(), signal.SIGINT)
"""


def run(program):
    # In a shell's background, SIGINT is ignored, and children inherit that.
    program = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n" + textwrap.dedent(PREAMBLE) + textwrap.dedent(program)
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)


def test_it_stops_with_the_best_estimate():
    ended = run(
        """
        before = graph.chi2()
        summary = cairn.optimize(graph, tolerance=0, initial=None, max_iterations=10**6, callback=press)
        assert summary.status == "interrupted", summary
        assert 3 <= len(summary.iterations) <= 4, summary
        assert abs(graph.chi2() / summary.chi2 - 1) < 1e-12 and summary.chi2 < before
        print("went on")
        """
    )
    assert (ended.returncode, ended.stdout) == (0, "went on\n"), ended.stderr


def test_it_stops_without_a_callback_too():
    ended = run(
        """
        import threading
        begun = threading.Event()
        threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
        summary = cairn.optimize(graph, tolerance=0, initial=None, max_iterations=10**8)
        assert summary.status == "interrupted", summary
        print("went on")
        """
    )
    assert (ended.returncode, ended.stdout) == (0, "went on\n"), ended.stderr


def test_afterwards_ctrl_c_is_what_it_was():
    ended = run(
        """
        handler = signal.getsignal(signal.SIGINT)
        for _ in range(2):
            assert cairn.optimize(graph.copy(), callback=press, tolerance=0).status == "interrupted"
        assert cairn.optimize(graph.copy()).status == "converged"
        assert signal.getsignal(signal.SIGINT) is handler
        try:
            os.kill(os.getpid(), signal.SIGINT)
            for _ in range(10**6): pass
            print("lost")
        except KeyboardInterrupt:
            print("raised")
        """
    )
    assert (ended.returncode, ended.stdout) == (0, "raised\n"), ended.stderr


def test_a_handler_of_ones_own_is_called():
    ended = run(
        """
        def handler(number, frame):
            raise LookupError("of the handler")
        signal.signal(signal.SIGINT, handler)
        def kill(iteration):
            if iteration.number == 3:
                signal.raise_signal(signal.SIGINT)
        try:
            cairn.optimize(graph, tolerance=0, max_iterations=10**6, callback=kill)
        except LookupError as error:
            print(error)
        """
    )
    assert (ended.returncode, ended.stdout) == (0, "of the handler\n"), ended.stderr


def test_where_it_is_ignored_it_stays_so():
    ended = run(
        """
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        summary = cairn.optimize(graph, tolerance=0, max_iterations=6, initial=None, callback=press)
        print(summary.status)
        """
    )
    assert (ended.returncode, ended.stdout) == (0, "max_iterations\n"), ended.stderr
