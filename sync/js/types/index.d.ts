// The types of RTSG's JavaScript. State numbers and node numbers are exact up to 2^53; times are seconds since 1970.

/** A value of a field. Numbers of MF fields are one flat array, typed where the type is X3D's; MFString and MFNode are arrays. */
export type Value = boolean | number | string | readonly number[] | Uint8Array | Int32Array | Uint32Array | Float32Array | Float64Array |
  readonly string[] | readonly (readonly number[])[] | null;

export interface FieldType {
  readonly name: string;
  /** 2k for the k-th SF type, 2k + 1 for its MF type: see typeName(). */
  readonly type: number;
  readonly access: 'initializeOnly' | 'inputOnly' | 'outputOnly' | 'inputOutput';
  readonly aspect: number;
  readonly hidden: boolean;
  readonly default: Value;
  readonly minimum?: number;
  readonly maximum?: number;
  readonly allowed?: readonly string[];
  readonly accepts?: readonly string[];
}

export interface NodeType {
  readonly name: string;
  readonly component: string;
  readonly level: number;
  readonly kind: 'built in' | 'user' | 'PROTO' | 'EXTERNPROTO' | 'Script';
  readonly container: string;
  readonly implements: readonly string[];
  readonly declaration: string;
  readonly fields: readonly FieldType[];
}

export interface Route {
  readonly from: number;
  readonly fromField: number;
  readonly to: number;
  readonly toField: number;
  readonly isConnection: boolean;
}

export interface StreamHead {
  readonly version: number;
  readonly epoch: bigint;
  readonly dictionary: bigint;
  readonly builtin: number;
  readonly mode: 'state' | 'input' | 'lossy';
  readonly coding: number;
  readonly maxError: number;
  readonly creator: string;
  readonly start?: number;
}

/** A unit of log and wire. */
export interface StreamRecord {
  readonly kind: 'head' | 'frame' | 'keyframe' | 'index' | 'input' | 'request' | 'scene' | 'other';
  readonly flags: number;
  readonly from: number;
  readonly to: number;
  readonly time: number;
  /** 32 hexadecimal digits. */
  readonly hash: string;
  readonly payload: Uint8Array;
  /** Bytes, with its head. */
  readonly size: number;
  readonly offset: number;
}

/** What is malformed. */
export class FormatError extends Error {}

/** Reads numbers, texts and parts one after the other; throws a FormatError at the end. */
export class Reader {
  constructor(bytes: Uint8Array);
  readonly bytes: Uint8Array;
  at: number;
  readonly left: number;
  skip(count: number): void;
  take(count: number): Uint8Array;
  u8(): number;
  u16(): number;
  u32(): number;
  i32(): number;
  u64(): bigint;
  f32(): number;
  f64(): number;
  varint(): number;
  count(least: number): number;
  signed(): number;
  node(previous: number): number;
  text(): string;
  texts(): string[];
  part(): Reader;
}

/** The record at `at`, its checksum checked. Throws a FormatError. */
export function readRecord(bytes: Uint8Array, at?: number, mostPayload?: number): StreamRecord;
/** Where the next record may begin, from `at` on; the end if there is none. */
export function findRecord(bytes: Uint8Array, at: number): number;
/** The payload of a head record. */
export function readHead(payload: Uint8Array): StreamHead;
/** All intact records; `damage` is called for the bytes between. */
export function records(bytes: Uint8Array, damage?: (place: Damage) => void): Generator<StreamRecord, void, undefined>;
/** "SFVec3f", "MFNode", … of a number. */
export function typeName(type: number): string;

/** Sets the tables that scene files (.rtsgb) refer to: the bytes of tables/catalogue.bin and tables/words.bin. */
export function setCatalogue(catalogue: Uint8Array, words: Uint8Array): void;
/** Fetches these two from the folder `tables` of this package, or from another; Node needs it not. */
export function loadCatalogue(folder?: string | URL): Promise<void>;
/** Sets what inflates a raw deflate stream; Node has one. */
export function setInflate(inflate: (bytes: Uint8Array, options: {maxOutputLength: number; dictionary?: Uint8Array}) => Uint8Array): void;

/** Decodes records into a scene, with the memory that predicted values need. */
export class Decoder {
  restart(): void;
  decode(record: StreamRecord, sink: Scene): void;
}

export class Node {
  readonly id: number;
  readonly type: NodeType;
  readonly scope: number;
  readonly name: string;
  readonly routes: readonly Route[];
  /** The value of a field, by name or number. Throws a RangeError for one that there is not. */
  get(field: string | number): Value;
}

export class Scene {
  /** Called once for each record, after it is applied, with what it set: node, number of the field, node, number, … in one flat
   * array, values of new nodes too. Not in it are names, routes, and that nodes are gone. null: nobody is told. */
  listener: ((changed: readonly (Node | number)[]) => void) | null;
  readonly nodes: ReadonlyMap<number, Node>;
  readonly names: ReadonlyMap<string, number>;
  readonly root: Node;
  readonly hash: {hex(): string};
  readonly state: number;
  readonly time: number;
  readonly epoch: bigint;
  countsFields: boolean;
  node(id: number): Node;
  /** The node of a DEF name. */
  find(name: string): Node | undefined;
  /** Applies a record that follows from this state, or a whole state. True if the state then has the record's hash. */
  apply(record: StreamRecord, decoder: Decoder): boolean;
  reset(): void;
  /** All that differs from a scene of defaults, for JSON. */
  dump(): {nodes: Record<string, unknown>; routes: unknown[]; [more: string]: unknown};
}

export interface Damage {
  readonly offset: number;
  readonly length: number;
}

/** Plays a log, or a scene file as a log of one state. */
export class Replay {
  constructor(bytes: Uint8Array);
  readonly scene: Scene;
  readonly head: StreamHead | null;
  readonly states: number;
  readonly verified: number;
  readonly gaps: number;
  readonly damage: readonly Damage[];
  readonly closed: boolean;
  readonly goesOn: boolean;
  readonly unclosedSessions: number;
  /** Whether the last state had the hash that its origin had. */
  readonly equal: boolean;
  /** The record that led to the next state; null at the end. */
  step(): StreamRecord | null;
}

export interface FieldValue {
  readonly node: number;
  readonly field: number;
  readonly type: number;
  readonly value: Value;
}

export interface MirrorOptions {
  name?: string;
  /** Bytes under way. */
  window?: number;
  /** Milliseconds behind at most; 0: any. */
  lag?: number;
  /** Bytes a second at most; 0: any. */
  rate?: number;
  nearFirst?: boolean;
  /** DEF names, or one `region:EYE,50`. */
  parts?: readonly string[];
  onState?(record: StreamRecord, equal: boolean): void;
  onReset?(): void;
  onWelcome?(resumed: boolean): void;
  onBye?(state: number): void;
  onRefused?(reason: string): void;
  onOrigin?(lost: boolean): void;
  onVerdict?(verdict: {request: number; state: number; reason: string; kept: string}): void;
  onReply?(text: string): void;
  onTrouble?(text: string): void;
}

export interface MirrorCounts {
  states: number;
  equal: number;
  unequal: number;
  keyframes: number;
  gaps: number;
  garbage: number;
  bytes: number;
  resumed: number;
}

/** A client of a mirror server for any transport: it calls `send`, and is given what comes by receive(). */
export class Mirror {
  constructor(send: (first: Uint8Array, second?: Uint8Array) => void, options?: MirrorOptions);
  readonly scene: Scene;
  readonly options: MirrorOptions;
  readonly connected: boolean;
  readonly hasState: boolean;
  readonly originLost: boolean;
  readonly gone: boolean;
  readonly count: Readonly<MirrorCounts>;
  hello(afresh?: boolean): void;
  bye(): void;
  cut(): void;
  /** Call it a few times a second. True while the server is heard. */
  tick(now?: number): boolean;
  receive(first: Uint8Array, second: Uint8Array): void;
  /** Asks for input events, and for edits of fields; returns the request's number, which its verdict has, too. */
  submitEvents(events: readonly FieldValue[]): number;
  submitEdits(edits: readonly FieldValue[]): number;
  undo(): number;
  redo(): number;
  /** Reserves nodes for so many milliseconds, at most 60,000; 0 releases them. */
  lock(nodes: readonly number[], lease: number): number;
  /** A command to the player of a log: "pause", "seek 3". */
  control(command: string): void;
}

export interface WebSocketOptions extends MirrorOptions {
  onConnection?(state: 'connecting' | 'open' | 'lost'): void;
}

/** What followWebSocket() needs of a class of sockets; browsers' WebSocket has it. */
export interface SocketClass {
  new (url: string): {
    binaryType: string;
    readonly readyState: number;
    send(data: Uint8Array): void;
    close(): void;
    onopen: ((event: any) => void) | null;
    onmessage: ((event: any) => void) | null;
    onerror: ((event: any) => void) | null;
    onclose: ((event: any) => void) | null;
  };
}

/** Follows a server of `rtsg serve --web`, and comes back after a cut. */
export function followWebSocket(url: string, options?: WebSocketOptions, Socket?: SocketClass): {
  readonly mirror: Mirror;
  cut(): void;
  close(): void;
};

/** Writes what Reader reads. */
export class Writer {
  u8(x: number): this;
  u16(x: number): this;
  u32(x: number): this;
  i32(x: number): this;
  u64(x: number | bigint): this;
  f32(x: number): this;
  f64(x: number): this;
  raw(bytes: ArrayLike<number>): this;
  varint(x: number): this;
  delta(difference: number): this;
  text(text: string): this;
  texts(texts: readonly string[]): this;
  block(kind: number, count: number, body: Writer): this;
  done(): Uint8Array;
}
export function writeValue(writer: Writer, type: number, value: Value): Writer;
export function editRecord(edits: readonly FieldValue[]): Uint8Array;
export function eventRecord(events: readonly FieldValue[]): Uint8Array;
export function lockRecord(nodes: readonly number[], lease: number): Uint8Array;
export function undoRecord(): Uint8Array;
export function redoRecord(): Uint8Array;
