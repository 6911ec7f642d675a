#!/usr/bin/env bash
# Prepares a ROS 2 with the message types of this project, from PyPI, beside whatever the machine
# has.
#
#   eval "$(launch_scripts/ros_env.sh [DIR])"
#
# DIR (default: ${XDG_CACHE_HOME:-$HOME/.cache}/maes-ros) then holds a Python environment with rclpy
# on Fast DDS, the common interfaces, maes_msgs as built from msgs/, stand-ins for tf2_msgs and
# simulation_interfaces, and a small `ros2` (launch_scripts/ros2.py), because PyPI has none; the
# printed lines put it into the environment of the shell. What is there
# and up to date is kept: a second call takes no time, and a changed .msg file rebuilds the messages
# only.
#
# Needs: Linux on x86_64 (glibc 2.28 or later), Python 3.10 to 3.13 with venv and headers, a C and a
# C++ compiler, PyPI within reach. Progress goes to stderr. On failure the only line printed is
# `false`, so that the eval fails too; exit code 1.

set -euo pipefail

repo=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
requirements=$repo/launch_scripts/ros_requirements.txt

trap '[ $? -eq 0 ] || echo false' EXIT

say() { printf 'ros_env: %s\n' "$*" >&2; }
fail() {
    say "$@"
    exit 1
}

# The interpreter below any environment that is active now, because that one may be the one to
# replace.
find_python() {
    local name found
    for name in python3 python3.13 python3.12 python3.11 python3.10; do
        found=$("$name" -c 'import sys
if (3, 10) <= sys.version_info[:2] <= (3, 13):
    print(getattr(sys, "_base_executable", sys.executable))' 2>/dev/null) || continue
        [ -n "$found" ] && echo "$found" && return
    done
    return 1
}

check_machine() {
    [ "$(uname -s) $(uname -m)" = "Linux x86_64" ] ||
        fail "the ROS 2 wheels exist for Linux on x86_64 only; this is $(uname -s) on $(uname -m)"
    python=$(find_python) || fail "no Python from 3.10 to 3.13 found (the ROS 2 wheels exist for these); install python3"
    "$python" -c 'import ensurepip, venv' 2>/dev/null ||
        fail "$python cannot make virtual environments; install its venv module (Debian and Ubuntu: apt install python3-venv)"
    "$python" -c 'import os, sysconfig, sys
sys.exit(not os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h")))' ||
        fail "the headers of $python are missing; install them (Debian and Ubuntu: apt install python3-dev)"
    command -v "${CC:-cc}" >/dev/null || fail "no C compiler (${CC:-cc}); install one (Debian and Ubuntu: apt install gcc)"
    command -v "${CXX:-c++}" >/dev/null || fail "no C++ compiler (${CXX:-c++}); install one (Debian and Ubuntu: apt install g++)"
}

# One line that changes when any of the files does, or the way they are built.
fingerprint() {
    { declare -f install_wheels compile_together build_interfaces write_stand_in && cat "$@"; } | sha256sum | cut -d ' ' -f 1
}

# Whether the stamp file $1 holds $2.
is_stamped() { [ -f "$1" ] && [ "$(cat "$1")" = "$2" ]; }

# Runs a command whose output is of interest only if it fails. A variable `hint` of the caller goes
# into the message then.
run_logged() {
    local log=$1
    shift
    "$@" >>"$log" 2>&1 || {
        tail -n 30 "$log" >&2
        fail "failed: $* (the whole log: $log)${hint:+; $hint}"
    }
}

install_wheels() {
    local hint="is PyPI within reach, or the index that pip is set to?"
    say "installing ROS 2 from PyPI into $venv"
    rm -rf "$venv" "$dir/build"
    mkdir -p "$dir/build"
    run_logged "$dir/build/venv.log" "$python" -m venv "$venv"
    run_logged "$dir/build/pip.log" "$venv/bin/python" -m pip install --disable-pip-version-check \
        --no-compile --require-hashes -r "$requirements"
    # The wheels carry the include paths of the machine they were made on; CMake refuses paths that do not exist.
    local include site
    include=$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("include"))')
    site=$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
    sed -i -e "s#/opt/python/[^/\";]*/include/python3\.[0-9]*#$include#g" \
        -e "s#/opt/python/[^/\";]*/lib/python3\.[0-9]*/site-packages#$site#g" "$venv"/share/*/cmake/*.cmake
}

# CMake that compiles many messages at once, which takes half the time: most of it goes into the
# headers of ROS. Not those parts whose files cannot share a unit.
compile_together() {
    cat <<'END'
function(compile_together)
  get_property(targets DIRECTORY PROPERTY BUILDSYSTEM_TARGETS)
  list(FILTER targets INCLUDE REGEX "typesupport_(c|cpp|fastrtps_c|fastrtps_cpp|introspection_c)$")
  foreach(target IN LISTS targets)
    get_target_property(type ${target} TYPE)
    if(type STREQUAL "SHARED_LIBRARY")
      set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 16)
    endif()
  endforeach()
endfunction()
cmake_language(DEFER CALL compile_together)
END
}

# Builds the interface package in folder $2 under the name $1 and installs it into the environment.
# Nothing of an earlier build stays, and only a complete build leaves the stamp $3.
build_interfaces() {
    local name=$1 source=$2 stamp=$3 build=$dir/build/$1
    say "building $name"
    rm -f "$venv/maes_built_$name" "$build.log"
    [ ! -f "$build/install_manifest.txt" ] || xargs -d '\n' rm -f <"$build/install_manifest.txt"
    rm -rf "$build"
    mkdir -p "$build"
    compile_together >"$build/compile_together.cmake"
    run_logged "$build.log" in_environment cmake -G Ninja -S "$source" -B "$build" \
        -DCMAKE_BUILD_TYPE=Release -DCMAKE_C_FLAGS_RELEASE=-O1 -DCMAKE_CXX_FLAGS_RELEASE=-O1 -DBUILD_TESTING=OFF \
        -DCMAKE_PROJECT_INCLUDE="$build/compile_together.cmake" -DCMAKE_PREFIX_PATH="$venv" \
        -DCMAKE_INSTALL_PREFIX="$venv" -DPython3_EXECUTABLE="$venv/bin/python"
    run_logged "$build.log" in_environment cmake --build "$build"
    run_logged "$build.log" in_environment cmake --install "$build"
    echo "$stamp" >"$venv/maes_built_$name"
}

in_environment() { env -u PYTHONPATH AMENT_PREFIX_PATH="$venv" PATH="$venv/bin:$PATH" "$@"; }

# There are no wheels of some packages: stand-ins with the interfaces that this project uses, from
# its own interface files. Package $1 in folder $2, with dependencies $3, of all interface files
# below $4.
write_stand_in() {
    local name=$1 source=$2 dependencies=$3 files=$4 dependency
    rm -rf "$source"
    mkdir -p "$source"
    cp -r "$files/." "$source/"
    # Those of a single kind may lie side by side.
    if compgen -G "$source/*.msg" >/dev/null; then mkdir -p "$source/msg" && mv "$source"/*.msg "$source/msg/"; fi
    {
        printf 'cmake_minimum_required(VERSION 3.14)\nproject(%s)\nfind_package(ament_cmake REQUIRED)\n' "$name"
        printf 'find_package(rosidl_default_generators REQUIRED)\n'
        for dependency in $dependencies; do printf 'find_package(%s REQUIRED)\n' "$dependency"; done
        printf 'rosidl_generate_interfaces(%s\n' "$name"
        (cd "$source" && find . -mindepth 2 -type f | LC_ALL=C sort | sed 's#^\./\(.*\)$#  "\1"#')
        printf '  DEPENDENCIES %s)\n' "$dependencies"
        printf 'ament_export_dependencies(rosidl_default_runtime)\nament_package()\n'
    } >"$source/CMakeLists.txt"
    sed -e "s#<name>.*</name>#<name>$name</name>#" \
        -e 's#<description>.*</description>#<description>Stand-in with what is needed only.</description>#' \
        "$repo/msgs/package.xml" >"$source/package.xml"
    for dependency in $dependencies; do
        grep -q "<depend>$dependency</depend>" "$source/package.xml" ||
            sed -i "s#^\( *\)<exec_depend>#\1<depend>$dependency</depend>\n&#" "$source/package.xml"
    done
}

# Builds the stand-in $1 with dependencies $2, unless it is there.
prepare_stand_in() {
    local name=$1 dependencies=$2 files=$repo/msgs/src/standard/$1 stamp
    stamp=$(find "$files" -type f | LC_ALL=C sort | tr '\n' '\0' | xargs -0 cat "$repo/msgs/package.xml" | fingerprint -)
    if ! is_stamped "$venv/maes_built_$name" "$stamp"; then
        write_stand_in "$name" "$dir/build/${name}_source" "$dependencies" "$files"
        build_interfaces "$name" "$dir/build/${name}_source" "$stamp"
    fi
}

prepare() {
    # One call at a time: a second one waits here and then finds everything in place.
    exec 9>"$dir/lock"
    if command -v flock >/dev/null; then flock 9; fi

    local stamp
    stamp="$(fingerprint "$requirements") $venv"
    if ! is_stamped "$venv/maes_wheels" "$stamp"; then
        check_machine
        install_wheels
        echo "$stamp" >"$venv/maes_wheels"
    fi

    prepare_stand_in octomap_msgs "std_msgs"
    prepare_stand_in tf2_msgs "action_msgs builtin_interfaces geometry_msgs std_msgs unique_identifier_msgs"
    prepare_stand_in simulation_interfaces "action_msgs builtin_interfaces geometry_msgs std_msgs unique_identifier_msgs"

    stamp=$(fingerprint "$repo/msgs/package.xml" "$repo/msgs/CMakeLists.txt" "$repo"/msgs/msg/*.msg "$repo"/msgs/srv/*.srv)
    if ! is_stamped "$venv/maes_built_maes_msgs" "$stamp"; then
        build_interfaces maes_msgs "$repo/msgs" "$stamp"
    fi
    install_ros2
}

# The commands of docs/ros2.md.
install_ros2() {
    { printf '#!%s\n' "$venv/bin/python" && tail -n +2 "$repo/launch_scripts/ros2.py"; } >"$venv/bin/.ros2"
    chmod +x "$venv/bin/.ros2"
    mv "$venv/bin/.ros2" "$venv/bin/ros2"
}

# The Python of the environment finds its libraries by itself, so LD_LIBRARY_PATH stays as it is.
# The paths of another ROS would be searched first and do not fit. ROS_DISTRO is not set, because
# ros2-client complains of any but the one it was built for.
print_exports() {
    case ":$PATH:" in
    *":$venv/bin:"*) ;;
    *) printf 'export PATH=%q:"$PATH"\n' "$venv/bin" ;;
    esac
    printf 'export AMENT_PREFIX_PATH=%q\n' "$venv"
    printf 'export PYTHONPATH=\n'
    printf 'export RMW_IMPLEMENTATION=rmw_fastrtps_cpp\n'
}

main() {
    [ $# -le 1 ] || fail "usage: ros_env.sh [DIR]"
    case ${1:-} in
    -*) fail "usage: ros_env.sh [DIR]" ;;
    esac
    dir=${1:-${XDG_CACHE_HOME:-${HOME:?}/.cache}/maes-ros}
    mkdir -p "$dir" || fail "cannot create $dir"
    dir=$(cd "$dir" && pwd)
    venv=$dir/venv

    prepare
    print_exports
}

# On one line with its end, so that an edit of this file does not reach a run that is under way.
main "$@"; exit
