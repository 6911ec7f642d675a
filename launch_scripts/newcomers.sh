#!/usr/bin/env bash
# Goes the three ways of docs/newcomers.md with a stopwatch:
#
#   launch_scripts/newcomers.sh [WAY...]      default: 1 2 3
#
# Executes the blocks of each section in an empty folder, prints for each command its wall time and
# processor time, and the words of the documents that the section names. `maes view` is measured to
# its first picture (viewer/bench/first-picture.mjs). Needs the build (launch_scripts/build.sh), the
# page, Chromium, and for the third way the packages of ros_env.sh. Exit code 1 if a command fails
# or more than 1500 words are read; times only inform.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
MAES_BIN_DIR=$("$root/launch_scripts/build.sh")
export MAES_BIN_DIR root
WORDS_MAX=1500
(($#)) || set -- 1 2 3

# The lines of a section of a document, by its number or its anchor; all lines without.
section() {
    awk -v wanted="${2:-}" '
        /^##+ / {
            name = tolower($0); sub(/^#+ /, "", name); gsub(/[^a-z0-9 -]/, "", name); gsub(/ /, "-", name)
            number += /^## /; shown = wanted == number || wanted == name
        }
        wanted == "" || shown' "$1"
}
# The words that a section tells to read, and its own.
words() {
    local total link file anchor
    total=$(section "$root/docs/newcomers.md" "$1" | wc -w)
    while read -r link; do
        file=${link%%#*} anchor=
        [[ $link != *#* ]] || anchor=${link#*#}
        if [[ $file == ../README.md ]]; then
            ((total += $(sed '/^## Recipes/,$d' "$root/README.md" | wc -w)))
        else
            ((total += $(section "$root/docs/$file" "$anchor" | wc -w)))
        fi
    done < <(section "$root/docs/newcomers.md" "$1" | sed -n '/^Read: /,/^$/p' | grep -o '([^)]*)' | tr -d '()')
    echo "$total"
}

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
mkdir "$folder/bin"
cat >"$folder/bin/maes" <<'END'
#!/usr/bin/env bash
# The program, with a stopwatch; `view` ends with the first picture.
TIMEFORMAT='%R s, %U s of processor time'
if [[ $1 == view ]]; then
    seconds=$(node "$root/viewer/bench/first-picture.mjs" "$MAES_BIN_DIR/maes" "$2") || exit 1
    echo "first picture after $seconds s: maes $*" >&3
else
    # shellcheck disable=SC2261
    { time "$MAES_BIN_DIR/maes" "$@" 2>errors.txt; } 2>time.txt || { cat errors.txt >&2; exit 1; }
    echo "$(cat time.txt): maes $*" >&3
fi
END
chmod +x "$folder/bin/maes"
export PATH="$folder/bin:$PATH" ROS_DOMAIN_ID=${ROS_DOMAIN_ID:-76}
exec 3>&1

failed=0
for way; do
    place=$folder/$way
    mkdir "$place"
    ln -s "$root/examples" "$place"
    mkdir "$place/launch_scripts"
    printf '#!/usr/bin/env bash\nexec "$root/launch_scripts/ros_env.sh" "$@"\n' >"$place/launch_scripts/ros_env.sh"
    chmod +x "$place/launch_scripts/ros_env.sh"
    "$MAES_BIN_DIR/maes" map generate --size 40 --seed 7 -o "$place/own.m3dm" >/dev/null
    "$MAES_BIN_DIR/maes" map convert "$place/own.m3dm" "$place/mine.obj" >/dev/null
    read -r title < <(section "$root/docs/newcomers.md" "$way")
    echo "$title"
    script=$(section "$root/docs/newcomers.md" "$way" | awk '/^```sh/ { on = 1; next } /^```/ { on = 0 } on')
    begun=$SECONDS
    if (cd "$place" && bash -euo pipefail -c "$script"$'\nfor job in $(jobs -p); do kill "$job" || :; done') >"$place/said.txt" 2>&1; then
        echo "$((SECONDS - begun)) s in all"
    else
        echo "failed: $(tail -n 5 "$place/said.txt")"
        failed=1
    fi
    count=$(words "$way")
    echo "$count words"
    ((count <= WORDS_MAX)) || failed=1
done
exit "$failed"
