#!/usr/bin/env bash
# Builds msgs/ with colcon: colcon_build.sh ROOT SCRATCH
#
# Distributions of Debian carry rosidl but neither the ROS 2 standard messages nor the meta packages that name the
# default generators. Both are made in SCRATCH: the messages from msgs/standard, the meta packages as lists of the
# generators for C, C++ and introspection.
set -euo pipefail

root=$1
scratch=$2
rm -rf "$scratch"
mkdir -p "$scratch/src"

# The dependencies of a standard package, in the order of need; a package not named here needs none.
declare -A needs=(
    [action_msgs]="builtin_interfaces unique_identifier_msgs"
    [std_msgs]="builtin_interfaces"
    [geometry_msgs]="std_msgs"
)

manifest() { # name, build type, group entry, dependency...
    local name=$1 group=$2
    shift 2
    echo '<?xml version="1.0"?>'
    echo '<package format="3">'
    echo "  <name>$name</name> <version>0.0.0</version> <description>Scratch copy.</description>"
    echo '  <maintainer email="nobody@probecell.invalid">nobody</maintainer> <license>Apache-2.0</license>'
    echo '  <buildtool_depend>ament_cmake</buildtool_depend>'
    for dependency in "$@"; do echo "  <depend>$dependency</depend>"; done
    [ -z "$group" ] || echo "  <member_of_group>$group</member_of_group>"
    echo '  <export><build_type>ament_cmake</build_type></export>'
    echo '</package>'
}

meta_package() { # name, package to find...
    local name=$1 folder=$scratch/src/$1
    shift
    mkdir -p "$folder"
    manifest "$name" "" >"$folder/package.xml"
    {
        echo 'cmake_minimum_required(VERSION 3.8)'
        echo "project($name NONE)"
        echo 'find_package(ament_cmake REQUIRED)'
        echo "ament_export_dependencies($*)"
        echo 'ament_package()'
    } >"$folder/CMakeLists.txt"
}

message_package() { # name
    local name=$1 folder=$scratch/src/$1 dependencies=${needs[$1]:-}
    mkdir -p "$folder"
    cp -r "$root/msgs/standard/$name/." "$folder"
    # shellcheck disable=SC2086
    manifest "$name" rosidl_interface_packages rosidl_default_generators $dependencies >"$folder/package.xml"
    {
        echo 'cmake_minimum_required(VERSION 3.8)'
        echo "project($name)"
        echo 'find_package(ament_cmake REQUIRED)'
        echo 'find_package(rosidl_default_generators REQUIRED)'
        for dependency in $dependencies; do echo "find_package($dependency REQUIRED)"; done
        echo "rosidl_generate_interfaces($name"
        (cd "$folder" && printf '  "%s"\n' */*.???)
        [ -z "$dependencies" ] || echo "  DEPENDENCIES $dependencies"
        echo ')'
        echo 'ament_package()'
    } >"$folder/CMakeLists.txt"
}

meta_package rosidl_default_generators \
    rosidl_cmake rosidl_generator_c rosidl_generator_cpp rosidl_typesupport_interface \
    rosidl_typesupport_introspection_c rosidl_typesupport_introspection_cpp
meta_package rosidl_default_runtime rosidl_runtime_c rosidl_runtime_cpp rosidl_typesupport_interface
for package in builtin_interfaces unique_identifier_msgs action_msgs std_msgs geometry_msgs; do
    message_package "$package"
done

cd "$scratch"
# A Cargo.toml at the root may hide the packages under it from colcon, so the project names their paths.
paths=("$root/msgs")
[ ! -e "$root/launch-scripts/package.xml" ] || paths+=("$root/launch-scripts")
listed=$(colcon --log-base log list --paths "${paths[@]}" | awk '{ print $1 " " $3 }')
echo "$listed"
grep -qx 'probecell_msgs (ros.ament_cmake)' <<<"$listed"
[ "$(wc -l <<<"$listed")" = "${#paths[@]}" ]

colcon --log-base log build --paths src/* "$root/msgs" --executor sequential \
    --cmake-args -DPython3_EXECUTABLE=/usr/bin/python3 -DBUILD_TESTING=OFF -DCMAKE_BUILD_TYPE=Debug

# What counts is code that compiled: libraries of our types, and every type's functions in them.
test -e install/probecell_msgs/lib/libprobecell_msgs__rosidl_typesupport_introspection_cpp.so
library=install/probecell_msgs/lib/libprobecell_msgs__rosidl_generator_c.so
symbols=$(nm --dynamic --defined-only "$library" | awk '{ print $3 }')
types=0
for file in "$root"/msgs/msg/*.msg; do
    grep -qx "probecell_msgs__msg__$(basename "$file" .msg)__init" <<<"$symbols"
    types=$((types + 1))
done
for file in "$root"/msgs/srv/*.srv; do
    name=$(basename "$file" .srv)
    grep -qx "probecell_msgs__srv__${name}_Request__init" <<<"$symbols"
    grep -qx "probecell_msgs__srv__${name}_Response__init" <<<"$symbols"
    types=$((types + 2))
done
echo "$types types compiled as C and C++"
