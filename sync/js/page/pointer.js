// What a mouse, a pen or a finger does in the picture, as a pointer of the origin: rays in world space, which are cast there
// (rtsg/core/device_input.h). So every sensor that acts at the origin acts from here.
//
// One finger points, two navigate. Moves go one a frame, and wait while the origin is slow to answer; presses and releases
// always go, in their order. Who leaves, or is cut off, lets go.

const ABSENT = 0, RAY = 1;  // kinds of PointerInput
const MFDOUBLE = 7;
const kDevices = 64, kRow = 9;  // of RtsgScene::_pointers: device, buttons, kind, bearing
const kMostUnanswered = 16;

export class PagePointer {
  /** `element` is what shows the picture; `ray(event)` gives {origin, direction} of a place on the page, or null. */
  constructor(element, mirror, ray) {
    this.element = element;
    this.mirror = mirror;
    this.ray = ray;
    this.device = 1 + Math.floor(Math.random() * (kDevices - 1));  // 0 moves the origin's viewer
    this.present = false;
    this.held = null;        // which of the browser's pointers is down
    this.fingers = new Set();
    this.waiting = null;     // the last move, not sent yet
    this.requests = new Set();
    this.isRefused = false;  // the origin takes nothing from here: moves are not worth the asking
    const on = (target, ...kinds) => kinds.forEach((kind) => target.addEventListener(kind, (event) => this[kind](event), true));
    on(element, 'pointerdown', 'pointerleave');
    on(window, 'pointermove', 'pointerup', 'pointercancel', 'blur');
  }

  // ---- what the browser says -------------------------------------------------------------------------------------------

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
    // A finger is then nowhere; nor is a mouse that was let go beside the picture over anything in it.
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

  // ---- what the origin is told -----------------------------------------------------------------------------------------

  /** The pointer is nowhere, and holds nothing. */
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
    const value = [this.device, buttons, ray ? RAY : ABSENT, ...bearing, 0];  // 0: what is met the origin finds out
    this.requests.add(this.mirror.submitEvents([{node: 1, field, type: MFDOUBLE, value}]));
  }
  /** One that nobody else points with, as far as the replica knows. */
  chooseDevice() {
    const {root} = this.mirror.scene, index = root.type.fields.findIndex((f) => f.name === '_pointers');
    const rows = root.values[index] ?? [], taken = new Set();
    for (let i = 0; i + kRow <= rows.length; i += kRow) if (rows[i + 1] || rows[i + 2] !== ABSENT) taken.add(rows[i]);
    if (taken.size < kDevices) while (taken.has(this.device)) this.device = (this.device + 1) % kDevices;
  }

  /** True if that was an answer to this pointer. */
  answered({request, reason}) {
    if (!this.requests.delete(request)) return false;
    this.isRefused = reason !== '';
    return true;
  }
  /** There is a server, perhaps another one: it may take what the last one refused, and has no answers for the last one's. */
  welcome() {
    this.isRefused = false;
    for (const request of this.requests) if (!this.mirror.requests.has(request)) this.requests.delete(request);
  }
}
