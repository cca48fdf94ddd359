"""Stands in for rclpy and its messages: launch_ros and ros2cli import them, a plain node of a launch file uses none."""

import importlib.abc
import importlib.machinery
import sys
from unittest import mock

PACKAGES = ("rclpy", "lifecycle_msgs", "composition_interfaces")


class Standin(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Finds and makes every module of the packages."""

    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in PACKAGES:
            return importlib.machinery.ModuleSpec(name, self, is_package=True)
        return None

    def create_module(self, spec):
        module = mock.MagicMock(name=spec.name)
        module.__path__ = []
        # Both are used as a class.
        module.ExternalShutdownException = type("ExternalShutdownException", (Exception,), {})
        module.Parameter = type("Parameter", (), {"Type": mock.MagicMock()})
        return module

    def exec_module(self, module):
        pass


sys.meta_path.insert(0, Standin())
