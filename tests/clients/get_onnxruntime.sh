#!/bin/bash
# Headers of ONNX Runtime from Debian 13, in a separate folder: nothing of the system is changed, and the library is
# that of the pip package. Usage: get_onnxruntime.sh FOLDER; then FOLDER/include has onnxruntime_c_api.h (100 kB to
# load, in addition to Debian's list of packages). Needs Debian's apt.
set -euo pipefail
folder=$(mkdir -p "${1:?Usage: get_onnxruntime.sh FOLDER}" && cd "$1" && pwd)
if [ -e "$folder/include/onnxruntime_c_api.h" ]; then exit; fi
apt=$(mktemp -d)
trap 'rm -rf "$apt"' EXIT
mkdir -p "$apt"/{state/lists/partial,cache/archives/partial}
echo "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] http://deb.debian.org/debian trixie main" >"$apt/sources.list"
options=(-qq -o "Dir::Etc::sourcelist=$apt/sources.list" -o Dir::Etc::sourceparts=- -o "Dir::State=$apt/state"
  -o "Dir::Cache=$apt/cache" -o Dir::State::status=/dev/null -o APT::Sandbox::User=root)
apt-get "${options[@]}" update
(cd "$apt" && apt-get "${options[@]}" download libonnxruntime-dev)
dpkg-deb --extract "$apt"/libonnxruntime-dev_*.deb "$apt/root"
mkdir -p "$folder/include"
cp "$apt"/root/usr/include/onnxruntime/onnxruntime_*.h "$folder/include"
