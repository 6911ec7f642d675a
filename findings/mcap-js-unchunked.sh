#!/usr/bin/env bash
# @mcap/core 2.2.2: a legal MCAP file without chunks has no messages, and a time window has one
# more than in mcap 1.6.0 of Python.
#
# Expected: chunks are optional (the specification allows messages in the data section directly),
# so a reader finds them or says that it cannot; one window gives the same messages in both
# languages.
# Seen: `McapIndexedReader` opens the file, its statistics say 5 messages, and `readMessages`
# yields none, without an error; so it is with a file whose chunks have no chunk index. Python
# reads all 5. The end of a window is inclusive in JavaScript and exclusive in Python.
# So: compare what was read with `statistics.messageCount` and fall back to `McapStreamReader`;
# writers for web viewers keep chunks and both indexes; a cutter of recordings says which end it
# means.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check mcap==1.6.0
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund @mcap/core@2.2.2 >/dev/null
"$dir/venv/bin/python" - <<'PY'
import warnings
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

warnings.simplefilter("ignore")

def write(name, **options):
    with open(name, "wb") as file:
        writer = Writer(file, compression=CompressionType.NONE, **options)
        writer.start()
        channel = writer.register_channel("/a", "json", 0)
        for time in range(1, 6):
            writer.add_message(channel, time, str(time).encode(), time)
        writer.finish()
    window = {"start_time": 2, "end_time": 4}
    read = lambda **limits: [m.log_time for _, _, m in make_reader(open(name, "rb")).iter_messages(**limits)]
    print("Python:    ", name, read(), "| from 2 to 4:", read(**window))
    assert read() == [1, 2, 3, 4, 5] and read(**window) == [2, 3]

write("chunks.mcap")
write("no-chunks.mcap", use_chunking=False)
write("no-chunk-index.mcap", index_types=IndexType.MESSAGE)
PY
cat > read.mjs <<'JS'
import fs from 'node:fs';
import {McapIndexedReader} from '@mcap/core';
async function read(name, window) {
  const data = fs.readFileSync(name);
  const readable = {
    size: async () => BigInt(data.length),
    read: async (offset, length) => new Uint8Array(data.subarray(Number(offset), Number(offset + length))),
  };
  const reader = await McapIndexedReader.Initialize({readable});
  const times = [];
  for await (const message of reader.readMessages(window)) times.push(Number(message.logTime));
  return {count: Number(reader.statistics.messageCount), times: times.join(' ')};
}
const changed = (what) => { console.error('changed: ' + what); process.exit(1); };
for (const name of ['chunks.mcap', 'no-chunks.mcap', 'no-chunk-index.mcap']) {
  const all = await read(name, {}), part = await read(name, {startTime: 2n, endTime: 4n});
  console.log('JavaScript:', name, `[${all.times}] of ${all.count} | from 2 to 4: [${part.times}]`);
  const chunks = name === 'chunks.mcap';
  if (all.times !== (chunks ? '1 2 3 4 5' : '') || all.count !== 5) changed(name + ' gives ' + all.times);
  if (part.times !== (chunks ? '2 3 4' : '')) changed(name + ' from 2 to 4 gives ' + part.times);
}
JS
node read.mjs
