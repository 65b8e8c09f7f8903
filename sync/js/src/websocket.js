// Follows a mirror by a WebSocket of `rtsg serve --web` (PROTOCOL.md, "Browsers"). It reconnects whenever the
// connection ends.

import {Mirror} from './mirror.js';

const kTick = 100, kFirstWait = 250, kLongestWait = 2000;  // ms

function pack(first, second) {
  const bytes = new Uint8Array(4 + first.length + (second?.length ?? 0));
  new DataView(bytes.buffer).setUint32(0, first.length, true);
  bytes.set(first, 4);
  if (second) bytes.set(second, 4 + first.length);
  return bytes;
}

/** `options` are Mirror's, and onConnection('connecting' | 'open' | 'lost'). `close()` ends it. */
export function followWebSocket(url, options = {}, Socket = WebSocket) {
  let socket = null, wait = kFirstWait, ended = false;
  const empty = new Uint8Array(0);
  const mirror = new Mirror((first, second) => {
    if (socket?.readyState === 1) socket.send(pack(first, second));
  }, options);
  function connect() {
    if (ended) return;
    mirror.tell('onConnection', 'connecting');
    const own = socket = new Socket(url);
    own.binaryType = 'arraybuffer';
    own.onopen = () => {
      wait = kFirstWait;
      mirror.tell('onConnection', 'open');
      mirror.hello();
    };
    own.onmessage = ({data}) => {
      if (own !== socket || typeof data === 'string' || data.byteLength < 4) return;
      const bytes = new Uint8Array(data), length = new DataView(data).getUint32(0, true);
      if (4 + length > bytes.length) return;
      mirror.receive(bytes.subarray(4, 4 + length), length + 4 < bytes.length ? bytes.subarray(4 + length) : empty);
    };
    own.onerror = () => {};  // onclose follows
    own.onclose = () => {
      if (own !== socket) return;
      mirror.cut();
      mirror.tell('onConnection', 'lost');
      setTimeout(connect, wait);
      wait = Math.min(2 * wait, kLongestWait);
    };
  }
  const timer = setInterval(() => {
    if (socket?.readyState !== 1) return;
    const was = mirror.connected;
    if (!mirror.tick() && was) socket.close();  // after a long silence another connection may work better
  }, kTick);
  timer.unref?.();
  connect();
  return {
    mirror,
    /** Drops the connection as the network might; for tests. */
    cut() { socket?.close(); },
    close() {
      ended = true;
      clearInterval(timer);
      if (socket?.readyState === 1) mirror.bye();
      socket?.close();
    },
  };
}
