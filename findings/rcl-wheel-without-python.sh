#!/usr/bin/env bash
# ros-rcl 10.1.3 (wheels of ROS 2 Kilted): a C program that is linked with librcl does not start
# without an interpreter.
#
# Expected: rcl is the C library below rclpy and rclcpp; a C program that creates a context links with
# librcl and what that needs.
# Seen: the program compiles and links. Started with the folders of all libraries in the search path,
# the loader ends it: `undefined symbol: PyExc_...` in
# libtype_description_interfaces__rosidl_generator_py.so. librcl lists the library of Python bindings
# of that package among those it needs, and that library leaves the symbols to an interpreter. The
# same code as a shared library that Python loads behind `import rclpy` works.
# So: nodes in C or C++ over these wheels are loaded into an interpreter by `ctypes`, or linked with
# libpython.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
cd "$dir"
venv/bin/pip install -q --no-compile --disable-pip-version-check ros-rclpy==9.1.2 ros-rcl==10.1.3 \
    ros-rmw-fastrtps-cpp==9.3.3 "numpy<3"
cat > context.c <<'C'
#include <rcl/rcl.h>
#include <stdio.h>

int main(int argc, char ** argv)
{
  rcl_init_options_t options = rcl_get_zero_initialized_init_options();
  rcl_context_t context = rcl_get_zero_initialized_context();
  int code = rcl_init_options_init(&options, rcl_get_default_allocator());
  code += rcl_init(argc, (const char * const *)argv, &options, &context);
  printf("rcl_init: %d\n", code);
  return code;
}
C
site=$(venv/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
lib=$dir/venv/lib
includes=$(printf -- '-I%s ' "$dir"/venv/include/*/)
# shellcheck disable=SC2086
cc $includes context.c -o context -L "$lib" -Wl,--allow-shlib-undefined -lrcl -lrcutils
# shellcheck disable=SC2086
cc -shared -fPIC $includes context.c -o context.so -L "$lib" -Wl,--allow-shlib-undefined -lrcl -lrcutils
path=$lib$(printf ':%s' "$site"/*.libs)
export AMENT_PREFIX_PATH=$dir/venv RMW_IMPLEMENTATION=rmw_fastrtps_cpp
seen=$(LD_LIBRARY_PATH=$path ./context 2>&1) && { echo "changed: the program starts: $seen"; exit 1; }
echo "program:              $seen"
case $seen in *"undefined symbol: Py"*) ;; *) echo "changed: another reason"; exit 1 ;; esac
LD_LIBRARY_PATH=$lib venv/bin/python - <<'PY'
import ctypes

import rclpy  # noqa: F401

print("loaded behind rclpy: ", end="", flush=True)
code = ctypes.CDLL("./context.so").main(1, (ctypes.c_char_p * 2)(b"context", None))
assert code == 0, "changed: rcl_init fails in the interpreter"
PY
