// npm's @jwetzell/posistagenet as a decoder. Standard input has packets in base64, a line each. Standard output has a
// JSON line for every frame of DATA packets that is whole, with all its trackers. The first argument is the package's
// folder.

import { createInterface } from 'node:readline';
import { pathToFileURL } from 'node:url';

const { Decoder } = await import(pathToFileURL(`${process.argv[2]}/dist/esm/index.js`));
const decoder = new Decoder();
for await (const line of createInterface({ input: process.stdin })) {
  const packet = new Uint8Array(Buffer.from(line, 'base64'));
  decoder.decode(packet);
  const isData = packet[0] === 0x55;
  if (isData && Object.keys(decoder.dataPacketFrames).length === 0) {
    const vector = (it) => [it.x, it.y, it.z];
    const trackers = Object.values(decoder.trackers).map((it) =>
      [it.id, vector(it.pos), vector(it.speed), vector(it.ori), it.validity, Number(it.timestamp), it.name]);
    console.log(JSON.stringify(trackers));
  }
}
