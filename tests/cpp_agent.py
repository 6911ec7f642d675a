"""Runs the agent of examples/cpp as the agent AGENT, from sources: cpp_agent.py FOLDER AGENT.

Compiled into FOLDER, as a library: the rcl of the wheels loads libraries of Python packages, which
a program without an interpreter cannot (undefined symbol PyExc_RuntimeError, ros-rcl 10.1.3).
"""

import ctypes
import glob
import os
import subprocess
import sys

# Loads rcl and the middleware with all that they need.
import maes_msgs.msg
import rclpy  # noqa: F401

folder, agent = sys.argv[1:]
tests = os.path.dirname(os.path.abspath(__file__))
source = os.path.join(tests, "..", "examples", "cpp", "src", "agent.cpp")
library = os.path.join(folder, "agent.so")
prefix = os.path.dirname(os.path.dirname(os.path.dirname(os.path.dirname(os.path.dirname(maes_msgs.__file__)))))
lib = os.path.join(prefix, "lib")
includes = [word for place in glob.glob(os.path.join(prefix, "include", "*")) for word in ("-isystem", place)]
needed = ["-lrcl", "-lrcutils", "-lmaes_msgs__rosidl_typesupport_cpp"]
compiler = [os.environ.get("CXX", "c++"), "-std=c++20", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC"]
link = ["-L", lib, f"-Wl,-rpath,{lib}", "-Wl,--allow-shlib-undefined", *needed]
subprocess.run([*compiler, "-I", tests, *includes, source, "-o", library, *link], check=True)
arguments = (ctypes.c_char_p * 3)(b"agent", agent.encode(), None)
sys.exit(ctypes.CDLL(library).main(2, arguments))
