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


def test_ctrl_c_and_exit_in_a_factor_end_an_update_as_they_are_and_leave_the_estimator():
    ended = run(
        """
        import numpy as np
        calls, at = [], [None, None]

        def residual(pose, point, measured):
            calls.append(1)
            if len(calls) == at[0]:
                at[1]()
            return np.hypot(*(point - pose[:, :2]).T)[:, None] - measured

        def press():
            os.kill(os.getpid(), signal.SIGINT)
            for _ in range(10**6): pass

        def leave():
            raise SystemExit(3)

        distance = cairn.FactorType("EDGE_DISTANCE", [cairn.Pose2, cairn.Point2], residual, residual_size=1, measurement_size=1)

        def built(name):
            estimator = cairn.Estimator(name)
            estimator.add(0, cairn.Pose2(), fixed=True)
            estimator.add(1, cairn.Pose2(1, 0, 0))
            estimator.add(100, cairn.Point2(3, 4))
            estimator.add(cairn.Between(0, 1, cairn.Pose2(1, 0, 0)), sigmas=0.1)
            estimator.add(cairn.Observation(0, 100, cairn.Point2(3, 4)), sigmas=0.2)
            estimator.add(cairn.Measurement(distance, [0, 100], [5.0]), sigmas=0.1)
            estimator.update()
            return estimator

        def grow(estimator):
            estimator.add(2, cairn.Pose2(2, 0, 0))
            estimator.add(cairn.Between(1, 2, cairn.Pose2(1, 0.1, 0)), sigmas=0.1)
            estimator.add(cairn.Measurement(distance, [2, 100], [4.0]), sigmas=0.1)
            estimator.update()

        raised = 0
        for name in cairn.components("estimator"):
            for end, kind in ((press, KeyboardInterrupt), (leave, SystemExit)):
                for call in range(1, 8):
                    at[0] = None
                    estimator, twin = built(name), built(name)
                    calls.clear()
                    at[:] = call, end
                    try:
                        grow(estimator)
                    except kind:
                        raised += 1
                        at[0] = None
                        assert estimator.variable_count == twin.variable_count, (name, call)
                        assert estimator.chi2() == twin.chi2(), (name, call)
                    at[0] = None
                    if len(calls) < call:
                        break
                    if estimator.variable_count == 3:
                        grow(estimator)
                    grow(twin)
                    assert estimator.chi2() == twin.chi2(), (name, call)
        print("raised" if raised > 20 else raised)
        """
    )
    assert (ended.returncode, ended.stdout) == (0, "raised\n"), ended.stderr


def test_exit_in_a_factor_passes_whatever_calls_it():
    ended = run(
        """
        import numpy as np
        armed = [False]

        def residual(pose, measured):
            if armed[0]:
                raise SystemExit(3)
            return pose - measured

        known = cairn.FactorType("EDGE_KNOWN", [cairn.Pose2], residual, residual_size=3, measurement_size=3)
        graph.add(cairn.Measurement(known, [0], graph.at(0).state), sigmas=0.1)
        for call in (graph.chi2, lambda: cairn.optimize(graph.copy()), lambda: cairn.optimize(graph.copy(), "dogleg", initial=None),
                     lambda: cairn.marginals(graph, [1]), lambda: known.check([graph.at(0).state], graph.at(0).state)):
            armed[0] = True
            try:
                call()
                print("nothing", call)
            except SystemExit as exit:
                assert exit.code == 3
            armed[0] = False
        print("passed")
        """
    )
    assert (ended.returncode, ended.stdout) == (0, "passed\n"), ended.stderr


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
