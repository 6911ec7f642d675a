#!/usr/bin/env bash
# eclipse-zenoh 1.10.2: three replies to a query arrive as one, and all three if the selector has a
# time range; a queryable may answer in another's name.
#
# Expected: `query.reply` three times, three replies; a parameter `_time` says which of them are
# wanted; a reply to the query `q/**` comes from where it says.
# Seen: replies of one key are consolidated to the last by default; the mere presence of
# `?_time=[..]` in the selector switches that off and lets all three through, without any filter on
# time. A queryable declared on `q/c` can reply as `q/other`, as long as the query's own expression
# covers it.
# So: to get the parts of a map by one key, ask with ConsolidationMode.NONE, or give each part its
# own key; do not take the key of a reply for the identity of the one who answered.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check eclipse-zenoh==1.10.2
"$dir/venv/bin/python" - <<'PY'
import sys
import zenoh

config = zenoh.Config()
for key, value in (("mode", '"peer"'), ("scouting/multicast/enabled", "false"), ("listen/endpoints", "[]")):
    config.insert_json5(key, value)
with zenoh.open(config) as session:
    def three(query):
        for part in ("0", "1", "2"):
            query.reply("d/a", part)

    first = session.declare_queryable("d/a", three)
    second = session.declare_queryable("q/c", lambda query: query.reply("q/other", "x"))
    ask = lambda selector, **options: [r.ok.payload.to_string() for r in session.get(selector, timeout=5.0, **options)]
    plain, timed = ask("d/a"), ask("d/a?_time=[now(-1h)..]")
    none = ask("d/a", consolidation=zenoh.ConsolidationMode.NONE)
    names = [str(r.ok.key_expr) for r in session.get("q/**", timeout=5.0)]
print("d/a:", plain, "| with _time:", timed, "| without consolidation:", none, "| names:", names)
if plain != ["2"] or none != ["0", "1", "2"]:
    sys.exit("changed: replies are %s and %s" % (plain, none))
if timed != ["0", "1", "2"] or names != ["q/other"]:
    sys.exit("changed: with a time they are %s, names %s" % (timed, names))
PY
