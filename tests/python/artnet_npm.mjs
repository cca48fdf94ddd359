// Sends or receives ArtTimeCode by npm's @arcanewizards/artnet: the package's folder, the port, then the seconds or
// `receive`. It sends from 00:00:10:00 at 25 frames a second for these seconds. Or it prints `listening`, and the parts
// of each label as a JSON line.

import { pathToFileURL } from 'node:url';

const [, , folder, port, seconds] = process.argv;
const { createArtnet } = await import(pathToFileURL(`${folder}/dist/index.js`));
const mode = seconds === 'receive' ? 'receive' : 'send';
const place = mode === 'receive' ? { type: 'interface', interface: 'lo' } : { type: 'host', host: '127.0.0.1' };
const artnet = createArtnet({ ...place, port: Number(port), mode });
artnet.on('timecode', ({ hours, minutes, seconds, frame }) => {
  console.log(JSON.stringify([hours, minutes, seconds, frame]));
});
await artnet.connect();
if (mode === 'receive') {
  console.log('listening');
} else {
  const began = performance.now();
  for (let frame = 0; frame < 25 * seconds; frame++) {
    const wait = began + 40 * frame - performance.now();
    await new Promise((resolve) => setTimeout(resolve, Math.max(0, wait)));
    artnet.sendTimecode('EBU', 10_000 + 40 * frame);
  }
  await artnet.destroy();
}
