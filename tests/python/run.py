# SPDX-License-Identifier: BSD-3-Clause
"""Runs a file of tests with pytest; ends with 77, which is "skipped", where a module is missing."""
import importlib
import sys

MORE = {"test_docs": ["matplotlib"], "test_notebook": ["matplotlib", "nbformat", "nbclient", "ipykernel"],
        "test_ros_node": ["rospy", "roslaunch", "nav_msgs", "visualization_msgs", "tf2_msgs"]}
for module in ["numpy", "pytest", *(module for name, modules in MORE.items() if name in sys.argv[1] for module in modules)]:
    try:
        importlib.import_module(module)
    except ImportError:
        print(f"skipped: there is no module {module} (python3-{module.replace('_', '-')}) for {sys.executable}")
        sys.exit(77)

import pytest

sys.exit(pytest.main(["-q", "-p", "no:cacheprovider", "-W", "error", "-rs", *sys.argv[1:]]))
