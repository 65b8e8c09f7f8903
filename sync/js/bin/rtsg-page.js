#!/usr/bin/env node
// rtsg-page FOLDER SERVER [PORT]: serves a page of one's own from a folder, with what it follows: WebSockets at /mirror, and pictures and
// sounds, come from SERVER (host:port of `rtsg serve --web`), which answers pages of its own address alone. On this machine only.
import {createReadStream, statSync} from 'node:fs';
import {createServer, request as ask} from 'node:http';
import path from 'node:path';

const [folder, server, port = '0'] = process.argv.slice(2);
if (!folder || !/^[^/]+:\d+$/.test(server ?? '') || !/^\d+$/.test(port)) {
  console.error('usage: rtsg-page FOLDER HOST:PORT [PORT]');
  process.exit(2);
}
const root = path.resolve(folder), [host, at] = [server.slice(0, server.lastIndexOf(':')), Number(server.slice(server.lastIndexOf(':') + 1))];
const kTypes = {'.html': 'text/html', '.js': 'text/javascript', '.mjs': 'text/javascript', '.css': 'text/css', '.json': 'application/json', '.png': 'image/png',
  '.jpg': 'image/jpeg', '.svg': 'image/svg+xml', '.wasm': 'application/wasm'};
const isPassedOn = (url) => /^\/(mirror|picture|sound)\b/.test(url);
/** The same request to the server, as if from a page of its own. */
const passOn = (request) => ask({host, port: at, method: request.method, path: request.url,
  headers: {...request.headers, host: server, ...(request.headers.origin && {origin: `http://${server}`})}});

const page = createServer((request, response) => {
  const end = (status) => response.writeHead(status).end();
  if (isPassedOn(request.url)) {
    const asked = passOn(request).on('error', () => end(502)).on('response', (answer) => {
      response.writeHead(answer.statusCode, answer.headers);
      answer.pipe(response);
    });
    return request.pipe(asked);
  }
  let file;
  try {
    file = path.join(root, decodeURIComponent(new URL(request.url, 'http://x').pathname));
    if (statSync(file).isDirectory()) file = path.join(file, 'index.html');
    if (path.relative(root, file).startsWith('..') || !statSync(file).isFile()) return end(404);
  } catch {
    return end(404);
  }
  response.writeHead(200, {'content-type': kTypes[path.extname(file)] ?? 'application/octet-stream'});
  return createReadStream(file).on('error', () => response.destroy()).pipe(response);
});
page.on('upgrade', (request, socket, head) => {
  socket.on('error', () => socket.destroy());
  if (!isPassedOn(request.url)) return socket.destroy();
  return passOn(request).on('error', () => socket.destroy()).on('response', (answer) => {
    socket.end(`HTTP/1.1 ${answer.statusCode} ${answer.statusMessage}\r\nConnection: close\r\n\r\n`);
  }).on('upgrade', (answer, other, first) => {
    socket.write(`HTTP/1.1 101 Switching Protocols\r\n${Object.entries(answer.headers).map(([name, value]) => `${name}: ${value}\r\n`).join('')}\r\n`);
    if (first.length) socket.write(first);
    if (head.length) other.write(head);
    other.on('error', () => socket.destroy()).on('close', () => socket.destroy());
    socket.on('close', () => other.destroy());
    other.pipe(socket).pipe(other);
  }).end();
});
page.listen(Number(port), '127.0.0.1', () => console.log(`http://127.0.0.1:${page.address().port}/`));
