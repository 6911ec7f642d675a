#!/usr/bin/env bash
# mcap 0.26.0 (Rust): a writer that leaves out the checksums of chunks writes a wrong checksum of the
# data section.
#
# Expected: `calculate_chunk_crcs(false)` leaves the field of each chunk at 0, which the
# specification allows, and changes nothing else; the default `calculate_data_section_crc` covers
# the bytes that are in the file.
# Seen: without that option the checksum of DataEnd is right; with it, the same messages get one that
# does not match the file. The library's own reader does not look at it. mcap 1.6.0 of Python refuses
# the file when it validates: "crc validation failed in DataEnd".
# So: a recorder that saves this time also turns the checksum of the data section off; a reader that
# refuses says which of the two checksums it means.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check mcap==1.6.0
mkdir "$dir/src"
cd "$dir"
cat > Cargo.toml <<'TOML'
[package]
name = "writer"
version = "0.0.0"
edition = "2021"

[dependencies]
mcap = { version = "=0.26.0", default-features = false }
TOML
cat > src/main.rs <<'RS'
use std::{collections::BTreeMap, fs::File};

fn main() {
    for (name, crcs) in [("with.mcap", true), ("without.mcap", false)] {
        let options = mcap::WriteOptions::new().compression(None).calculate_chunk_crcs(crcs);
        let mut writer = options.create(File::create(name).unwrap()).unwrap();
        let channel = writer.add_channel(0, "/a", "json", &BTreeMap::new()).unwrap();
        for time in 1..=5 {
            let header =
                mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: time, publish_time: time };
            writer.write_to_known_channel(&header, b"{}").unwrap();
        }
        writer.finish().unwrap();
        let read = mcap::MessageStream::new(&std::fs::read(name).unwrap()).unwrap().count();
        println!("Rust:   {name}: {read} messages");
    }
}
RS
cargo run --quiet
"$dir/venv/bin/python" - <<'PY'
from mcap.stream_reader import CRCValidationError, StreamReader

def crc_is_right(name):
    try:
        list(StreamReader(open(name, "rb"), validate_crcs=True).records)
    except CRCValidationError as error:
        print(f"Python: {name}: {str(error).split(',')[0]}")
        return False
    print(f"Python: {name}: checksums are right")
    return True

assert crc_is_right("with.mcap"), "changed: the default file is refused"
assert not crc_is_right("without.mcap"), "changed: the checksum is right without those of chunks"
PY
