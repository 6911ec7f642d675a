#!/usr/bin/env bash
# Measures recordings and prints the figures of docs/benchmarks.md:
#
#   launch_scripts/bench_recordings.sh [ROUNDS] [FOLDER]      default: 5 rounds, a temporary folder
#
# Bytes of half an hour of ten agents, as the run and as Python's `mcap` writes it; processor time
# of a recorded run and of `maes verify`, each by that of a run in memory, in runs whose order turns
# from round to round; `maes diff` of two recordings of 1 GB with the same bytes, and of one and
# what `mcap` makes of it. Takes 3 GB of the folder, and packages of PyPI. With MAES_BIN_DIR set,
# its binaries run. The machine should have nothing else to do.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
maes=$("$here/build.sh")/maes
python=$("$here/../tests/python_env.sh" recording)
rounds=${1:-5}
out=$(mktemp -d "${2:-${TMPDIR:-/tmp}}/maes-bench-XXXXXX")
trap 'rm -rf "$out"' EXIT
TIMEFORMAT='%U %S %R'

# Seconds of the processor and of the wall.
seconds() { { time "$@" >"$out/stdout" 2>"$out/stderr"; } 2>&1 | awk '{print $1 + $2, $3}'; }

# The median of the ratios of a file with four columns: processor and wall of one, of the other.
ratios() { # WHAT FILE
    awk '{print $3 / $1, $4 / $2}' "$2" >"$2.ratios"
    printf '%-48s processor %.3f, wall %.3f (n = %d)\n' "$1" \
        "$(cut -d' ' -f1 "$2.ratios" | sort -g | awk '{v[NR] = $1} END {print v[int((NR + 1) / 2)]}')" \
        "$(cut -d' ' -f2 "$2.ratios" | sort -g | awk '{v[NR] = $1} END {print v[int((NR + 1) / 2)]}')" "$rounds"
}

# Writes a recording again with the package `mcap` and its defaults: chunks of 1 MiB, zstd.
rewrite() { # FROM TO
    "$python" - "$1" "$2" <<'END'
import sys
from mcap.reader import make_reader
from mcap.writer import Writer

schemas, channels = {}, {}
with open(sys.argv[1], "rb") as source, open(sys.argv[2], "wb") as target:
    reader, writer = make_reader(source), Writer(target)
    writer.start(reader.get_header().profile)
    for at in reader.iter_attachments():
        writer.add_attachment(at.create_time, at.log_time, at.name, at.media_type, at.data)
    for schema, channel, message in reader.iter_messages(log_time_order=False):
        if schema.id not in schemas:
            schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
        if channel.id not in channels:
            channels[channel.id] = writer.register_channel(
                channel.topic, channel.message_encoding, schemas[schema.id], dict(channel.metadata)
            )
        writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time)
    writer.finish()
END
}

echo "$(date -u +%Y-%m-%d), $(nproc) cores, load $(cut -d' ' -f1 /proc/loadavg)"
half_hour=(run --size 100 --seed 1 --set stop_when_explored=false --agents 10 --duration 1800 --transport memory)
for controller in dsvp rbw dsvp-team; do
    "$maes" "${half_hour[@]}" --controller "$controller" --record "$out/$controller.mcap" >"$out/stdout" 2>"$out/stderr"
    rewrite "$out/$controller.mcap" "$out/rewritten.mcap"
    echo "$controller: $(stat -c %s "$out/$controller.mcap") bytes; by mcap: $(stat -c %s "$out/rewritten.mcap")"
done
declare -A of
for ((round = 0; round < rounds; round++)); do
    kinds=(bare recorded verify)
    # Whatever comes first in a round is the second or third of the others.
    for ((turn = 0; turn < 3; turn++)); do
        kind=${kinds[(turn + round) % 3]}
        case $kind in
        bare) of[bare]=$(seconds "$maes" "${half_hour[@]}" --controller dsvp-team) ;;
        recorded) of[recorded]=$(seconds "$maes" "${half_hour[@]}" --controller dsvp-team --record "$out/again.mcap") ;;
        verify) of[verify]=$(seconds "$maes" verify "$out/dsvp-team.mcap") ;;
        esac
    done
    echo "${of[bare]} ${of[recorded]}" >>"$out/recorded"
    echo "${of[bare]} ${of[verify]}" >>"$out/verify"
done
ratios "recorded run by one that is not" "$out/recorded"
ratios "maes verify by the run" "$out/verify"

"$maes" run --size 100 --seed 1 --set stop_when_explored=false --controller rbw --agents 6 --duration 720 \
    --transport memory --record-topics points --record "$out/points.mcap" >"$out/stdout" 2>"$out/stderr"
cp "$out/points.mcap" "$out/other.mcap"
bytes=$(stat -c %s "$out/points.mcap")
diffs() { # WHAT
    echo "maes diff of two recordings of $bytes bytes, $1: processor and wall, s"
    for ((round = 0; round < rounds; round++)); do
        seconds "$maes" diff "$out/points.mcap" "$out/other.mcap"
        grep -q '^the same run: ' "$out/stdout"
    done
}
diffs "the same bytes"
rm "$out/other.mcap"
rewrite "$out/points.mcap" "$out/other.mcap"
diffs "one written again by mcap"
