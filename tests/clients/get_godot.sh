#!/bin/bash
# Godot 4 of Debian unstable, with the libraries that it needs, in a separate folder: nothing of the system is
# changed. Usage: get_godot.sh FOLDER; then FOLDER/godot is the engine (about 160 MB to load). Needs Debian's apt.
set -euo pipefail
folder=$(mkdir -p "${1:?Usage: get_godot.sh FOLDER}" && cd "$1" && pwd)
if [ -x "$folder/godot" ]; then exit; fi
apt=$(mktemp -d)
trap 'rm -rf "$apt"' EXIT
mkdir -p "$apt"/{state/lists/partial,cache/archives/partial}
echo "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] http://deb.debian.org/debian sid main" >"$apt/sources.list"
options=(-qq -o "Dir::Etc::sourcelist=$apt/sources.list" -o Dir::Etc::sourceparts=- -o "Dir::State=$apt/state"
  -o "Dir::Cache=$apt/cache" -o Dir::State::status=/dev/null -o APT::Sandbox::User=root)
apt-get "${options[@]}" update
apt-get "${options[@]}" install --yes --download-only --no-install-recommends godot
for package in "$apt"/cache/archives/*.deb; do dpkg-deb --extract "$package" "$folder/root"; done
libraries=$(cd "$folder/root/usr/lib/$(uname -m)-linux-gnu" && pwd)
loader=$(find "$libraries" -maxdepth 1 -name 'ld-linux-*.so.*' | head -1)
printf '#!/bin/sh\nexec "%s" --library-path "%s:%s/pulseaudio" "%s/root/usr/bin/godot" "$@"\n' \
  "$loader" "$libraries" "$libraries" "$folder" >"$folder/godot"
chmod +x "$folder/godot"
"$folder/godot" --headless --version
