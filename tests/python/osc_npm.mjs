// Receives or sends OSC by npm's node-osc: the package's folder, the port, then the messages to send, each an address
// with numbers after commas. Without messages it prints `listening`, and a JSON line for each message that comes.

import { pathToFileURL } from 'node:url';

const [, , folder, port, ...messages] = process.argv;
const { Client, Server } = await import(pathToFileURL(`${folder}/lib/index.mjs`));
if (messages.length > 0) {
  const client = new Client('127.0.0.1', Number(port));
  for (const message of messages) {
    const [address, ...numbers] = message.split(',');
    await client.send(address, ...numbers.map(Number));
  }
  await client.close();
} else {
  const server = new Server(Number(port), '127.0.0.1', () => console.log('listening'));
  server.on('message', ([address, ...args]) => console.log(JSON.stringify({ address, arguments: args })));
}
