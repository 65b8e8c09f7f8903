// Makes a mouse, a pen or a finger on the picture a pointer of the origin. The origin gets rays in world space and
// casts them (rtsg/core/device_input.h), so every sensor of the origin works from here.
//
// One finger points, two navigate. Moves are sent once a frame, and wait while the origin is slow to answer. Presses
// and releases are always sent, in order. A pointer that leaves, or whose connection ends, releases what it holds.

const ABSENT = 0, RAY = 1;  // kinds of PointerInput
const MFDOUBLE = 7;
const kDevices = 64, kRow = 9;  // of RtsgScene::_pointers: device, buttons, kind, bearing
const kMostUnanswered = 16;

export class PagePointer {
  /** `element` shows the picture; `ray(event)` returns {origin, direction} for a place on the page, or null. */
  constructor(element, mirror, ray) {
    this.element = element;
    this.mirror = mirror;
    this.ray = ray;
    this.device = 1 + Math.floor(Math.random() * (kDevices - 1));  // 0 moves the origin's viewer
    this.present = false;
    this.held = null;  // the browser's pointer that is down
    this.fingers = new Set();
    this.waiting = null;  // the last move that was not sent yet
    this.requests = new Set();
    this.isRefused = false;  // the origin accepts nothing from here, so moves are not sent
    const on = (target, ...kinds) => kinds.forEach((kind) => target.addEventListener(kind, (event) => this[kind](event), true));
    on(element, 'pointerdown', 'pointerleave');
    on(window, 'pointermove', 'pointerup', 'pointercancel', 'blur');
  }

  // ---- events of the browser
  // -------------------------------------------------------------------------------------------

  pointerdown(event) {
    if (event.pointerType === 'touch') {
      this.fingers.add(event.pointerId);
      if (this.fingers.size > 1) return this.leave();
    }
    if (event.button !== 0 || this.held !== null || !this.mirror.connected) return;
    this.held = event.pointerId;
    this.send(1, this.ray(event));
  }
  pointermove(event) {
    const isHeld = event.pointerId === this.held;
    if (!isHeld && (this.held !== null || event.pointerType === 'touch' || !this.element.contains(event.target))) return;
    if (this.isRefused || !this.mirror.connected) return;
    if (!this.waiting) requestAnimationFrame(() => this.flush());
    this.waiting = event;
  }
  pointerup(event) {
    this.fingers.delete(event.pointerId);
    if (event.pointerId !== this.held) return;
    this.held = null;
    this.send(0, this.ray(event));
    // A finger is then nowhere. A mouse that was released outside the picture is not over anything in it.
    if (event.pointerType === 'touch' || !this.element.contains(event.target)) this.leave();
  }
  pointercancel(event) {
    this.fingers.delete(event.pointerId);
    if (event.pointerId === this.held) this.leave();
  }
  pointerleave() {
    if (this.held === null) this.leave();
  }
  blur() { this.leave(); }

  // ---- events for the origin
  // -------------------------------------------------------------------------------------------

  /** Leaves: the pointer is nowhere and holds nothing. */
  leave() {
    this.held = this.waiting = null;
    if (this.present) this.send(0, null);
  }
  flush() {
    const event = this.waiting;
    if (!event) return;
    if (this.requests.size >= kMostUnanswered) {
      requestAnimationFrame(() => this.flush());
      return;
    }
    this.send(this.held === null ? 0 : 1, this.ray(event));
  }
  send(buttons, ray) {
    this.waiting = null;
    const {root} = this.mirror.scene, field = root.type.fields.findIndex((f) => f.name === 'pointer');
    if (field < 0 || (!ray && !this.present)) return;
    if (!this.present) this.chooseDevice();
    this.present = ray !== null;
    const bearing = ray ? [...ray.origin, ...ray.direction] : [0, 0, 0, 0, 0, 0];
    const value = [this.device, buttons, ray ? RAY : ABSENT, ...bearing, 0];  // 0: the origin finds out what is hit
    this.requests.add(this.mirror.submitEvents([{node: 1, field, type: MFDOUBLE, value}]));
  }
  /** Takes a device number that nobody else uses, as far as the replica knows. */
  chooseDevice() {
    const {root} = this.mirror.scene, index = root.type.fields.findIndex((f) => f.name === '_pointers');
    const rows = root.values[index] ?? [], taken = new Set();
    for (let i = 0; i + kRow <= rows.length; i += kRow) if (rows[i + 1] || rows[i + 2] !== ABSENT) taken.add(rows[i]);
    if (taken.size < kDevices) while (taken.has(this.device)) this.device = (this.device + 1) % kDevices;
  }

  /** Returns true if that was an answer to this pointer. */
  answered({request, reason}) {
    if (!this.requests.delete(request)) return false;
    this.isRefused = reason !== '';
    return true;
  }
  /** Call it when a server is there, perhaps another one. It may accept what the last one refused, and does not answer
   * earlier requests. */
  welcome() {
    this.isRefused = false;
    for (const request of this.requests) if (!this.mirror.requests.has(request)) this.requests.delete(request);
  }
}
