// Sends ArtTimeCode by npm's @arcanewizards/artnet: the package's folder, the port, the seconds. From 00:00:10:00 at 25 frames a
// second.

import { pathToFileURL } from 'node:url';

const [, , folder, port, seconds] = process.argv;
const { createArtnet } = await import(pathToFileURL(`${folder}/dist/index.js`));
const artnet = createArtnet({ type: 'host', host: '127.0.0.1', port: Number(port), mode: 'send' });
await artnet.connect();
const began = performance.now();
for (let frame = 0; frame < 25 * seconds; frame++) {
  const wait = began + 40 * frame - performance.now();
  await new Promise((resolve) => setTimeout(resolve, Math.max(0, wait)));
  artnet.sendTimecode('EBU', 10_000 + 40 * frame);
}
await artnet.destroy();
