#!/usr/bin/env bash
# @foxglove/omgidl-parser 1.1.0 and @foxglove/omgidl-serialization 1.0.3: a constant 010 is ten, and
# an array of two dimensions is written as zeros.
#
# Expected: in OMG IDL (as in C) an integer that begins with 0 is octal; `long a[2][3]` has six
# elements.
# Seen: `const long N = 010; octet a[N]` has ten elements, so every field behind it is read two
# bytes late; 0x10 and `2 * 3` are refused as syntax errors. Of `a[2][3]` the writer makes two
# elements of 0 and no error, and the reader then fails at these bytes.
# So: write constants in decimal and arrays in one dimension in types that a web viewer shows.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
npm init -y >/dev/null
npm install --silent --no-audit --no-fund @foxglove/omgidl-parser@1.1.0 @foxglove/omgidl-serialization@1.0.3 >/dev/null
cat > read.mjs <<'JS'
import {parseIDL} from '@foxglove/omgidl-parser';
import {MessageReader, MessageWriter} from '@foxglove/omgidl-serialization';
const changed = (what) => { console.error('changed: ' + what); process.exit(1); };
const attempt = (work) => { try { return work(); } catch (error) { return 'error: ' + error.message.split('\n')[0]; } };

const octal = parseIDL('const long N = 010; struct M { octet a[N]; octet b; };');
const length = octal.find((type) => type.name === 'M').definitions[0].arrayLengths;
const bytes = new Uint8Array([0, 1, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 99, 0, 0, 0]);
const b = attempt(() => new MessageReader('M', octal).readMessage(bytes).b);
console.log('octet a[010]: length', length, '| b, stored as 99 behind 8 elements, is read as', b);
if (String(length) !== '10' || b === 99) changed(`the length is ${length}, b is ${b}`);
for (const constant of ['0x10', '2 * 3']) {
  const result = attempt(() => parseIDL(`const long N = ${constant}; struct M { long a; };`) && 'read');
  console.log('const', constant + ':', result);
  if (!result.startsWith('error')) changed(constant + ' is read');
}
const square = parseIDL('struct M { long a[2][3]; };');
const bytesOfSquare = new MessageWriter('M', square).writeMessage({a: [[1, 2, 3], [4, 5, 6]]});
const written = Buffer.from(bytesOfSquare).toString('hex');
const back = attempt(() => new MessageReader('M', square).readMessage(new Uint8Array(bytesOfSquare)));
console.log('a[2][3] is written as', written, '|', back);
if (written !== '000100000000000000000000' || !String(back).startsWith('error')) changed('a[2][3] is written as ' + written);
JS
node read.mjs
