// RTSG's format in JavaScript, written from PROTOCOL.md.

export {FormatError, Reader} from './reader.js';
export {readRecord, findRecord} from './record.js';
export {loadCatalogue, readHead, setCatalogue} from './types.js';
export {Decoder, setInflate} from './decoder.js';
export {Scene, Node} from './scene.js';
export {Replay, records} from './log.js';
export {typeName} from './values.js';
export {Mirror} from './mirror.js';
export {followWebSocket} from './websocket.js';
export {Writer, editRecord, eventRecord, lockRecord, redoRecord, undoRecord, writeValue} from './writer.js';
