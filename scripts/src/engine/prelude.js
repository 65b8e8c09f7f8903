// What a Script sees besides ECMAScript itself: field values as objects, and nodes; Browser is in browser.js. ISO/IEC
// 19777-1 V3.3 clause 7.
//
// Evaluated once a thread, in a realm of its own whose objects no program can change; `native` is the bridge to the
// scene. It answers with the names that every program finds in its global object, and a function that makes a program's
// controller. A field is read when it is first touched in a call and kept until the call ends; then whatever was
// assigned, or has been changed in place since it was read (`points[3].y = 1`), goes to the scene in the order of first
// touch, as events where the field sends or takes them: of an output of its own also what is assigned once more in place
// (`out.x = out.x`). A function of Browser that changes the scene has all that sent
// before; objects that the program has been given stay the fields' own. What is refused then, is told of each by itself.
(function (native) {
    "use strict";

    const names = Object.create(null), library = native.common;
    /// Errors and arrays are the running program's own: it can tell them by `instanceof`.
    function fail(kind, text) { throw new (native.global()[kind])(text); }
    const jsonOf = value => native.global().JSON.stringify(value);
    const ownArray = list => native.global().Array.from(list);
    const isNumber = code => code <= SFTime && !(code & 1);
    const SFInt32 = 2, MFInt32 = 3, SFTime = 8, SFString = 10, SFNode = 12, MFNode = 13, SFImage = 18, SFRotation = 32, SFMatrix = 34, SFCustom = 42;
    const tuples = new Map();  // SF type code -> class
    const arrays = new Map();  // MF type code -> class
    const spares = new Map();  // SF type code -> an array for its components, between two statements
    const isObject = value => typeof value === "object" && value !== null;

    // ---- values of several numbers ---------------------------------------------------------------------------
    // Methods alone: constructors and what goes component by component are made below, class by class.
    class Tuple {
        map(f) { return new this.constructor(...this.components().map(f)); }
        zip(other, f) { const o = other.components(); return this.map((c, i) => f(c, o[i])); }
        equals(other) {
            if (!(other instanceof Tuple)) return false;
            const o = other.components(), own = this.components();
            return o.length === own.length && own.every((c, i) => c === o[i]);
        }
        copy() { return this.map(c => c); }
        lerp(to, t) { return this.zip(to, (a, b) => a + (b - a) * t); }
        toString() { return this.components().join(" "); }
        toVRMLString() { return this.toString(); }
        toXMLString() { return this.toString(); }
        toJSONString() { return jsonOf(this.components()); }
        toJSON() { return this.constructor.keys ? Object.fromEntries(this.constructor.keys.map(key => [key, this[key]])) : this.components(); }
        get [Symbol.toStringTag]() { return this.constructor.name; }
    }
    class Vector extends Tuple {
        add(v) { return this.zip(v, (a, b) => a + b); }
        subtract(v) { return this.zip(v, (a, b) => a - b); }
        multiply(s) { return this.map(a => a * s); }
        multiple(s) { return this.multiply(s); }  // the name in the standard
        divide(s) { return this.map(a => a / s); }
        multVec(v) { return this.zip(v, (a, b) => a * b); }
        divVec(v) { return this.zip(v, (a, b) => a / b); }
        negate() { return this.map(a => -a); }
        abs() { return this.map(Math.abs); }
        min(v) { return this.zip(v, Math.min); }
        max(v) { return this.zip(v, Math.max); }
        dot(v) { const o = v.components(); return this.components().reduce((sum, c, i) => sum + c * o[i], 0); }
        length() { return Math.hypot(...this.components()); }
        distance(v) { return this.subtract(v).length(); }
        normalize() { const l = this.length(); return l > 0 ? this.divide(l) : this.copy(); }
    }
    class Vector3 extends Vector {
        cross(v) {
            return new this.constructor(this.y * v.z - this.z * v.y, this.z * v.x - this.x * v.z, this.x * v.y - this.y * v.x);
        }
    }
    class Color extends Tuple {
        // Hue in degrees, saturation and value in [0, 1].
        setHSV(h, s, v) {
            const f = n => { const k = (n + h / 60) % 6; return v - v * s * Math.max(0, Math.min(k, 4 - k, 1)); };
            this.r = f(5); this.g = f(3); this.b = f(1);
        }
        getHSV() {
            const max = Math.max(this.r, this.g, this.b), d = max - Math.min(this.r, this.g, this.b);
            const h = d === 0 ? 0 : max === this.r ? ((this.g - this.b) / d + 6) % 6
                : max === this.g ? (this.b - this.r) / d + 2 : (this.r - this.g) / d + 4;
            return ownArray([h * 60, max === 0 ? 0 : d / max, max]);
        }
    }
    class Rotation extends Tuple {
        /// What the constructor takes besides components: two vectors, or an axis and an angle.
        static given(a, b) {
            return b instanceof Vector3 ? Rotation.between(a.normalize(), b.normalize()) : [a.x, a.y, a.z, b];
        }
        static between(from, to) {
            let axis = from.cross(to);
            const sine = axis.length(), cosine = from.dot(to);
            if (sine < 1e-12) {
                if (cosine >= 0) return [0, 0, 1, 0];
                // Opposite: any axis at right angles will do.
                axis = from.cross(Math.abs(from.x) < 0.5 ? new from.constructor(1, 0, 0) : new from.constructor(0, 1, 0));
            }
            axis = axis.normalize();
            return [axis.x, axis.y, axis.z, Math.atan2(sine, cosine)];
        }
        static fromQuaternion([x, y, z, w]) {
            const s = Math.hypot(x, y, z);
            return s < 1e-300 ? new names.SFRotation() : new names.SFRotation(x / s, y / s, z / s, 2 * Math.atan2(s, w));
        }
        quaternion() {
            const l = Math.hypot(this.x, this.y, this.z), s = l > 0 ? Math.sin(this.angle / 2) / l : 0;
            return [this.x * s, this.y * s, this.z * s, Math.cos(this.angle / 2)];
        }
        /// As rows: of a point times it.
        getMatrix() { return new names.SFMatrix3f(...[[1, 0, 0], [0, 1, 0], [0, 0, 1]].flatMap(axis => this.multVec(new names.SFVec3d(...axis)).components())); }
        setMatrix(matrix) {
            const c = matrix.components(), whole = new names.SFMatrix4d(...[0, 1, 2].flatMap(i => [...c.slice(3 * i, 3 * i + 3), 0]), 0, 0, 0, 1);
            whole.getTransform(undefined, this);
        }
        getAxis() { return new names.SFVec3f(this.x, this.y, this.z); }
        setAxis(axis) { this.x = axis.x; this.y = axis.y; this.z = axis.z; }
        inverse() { return new names.SFRotation(this.x, this.y, this.z, -this.angle); }
        // Turning by the result is turning by `r` first, then by this.
        multiply(r) {
            const [ax, ay, az, aw] = this.quaternion(), [bx, by, bz, bw] = r.quaternion();
            return Rotation.fromQuaternion([aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
                                            aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz]);
        }
        multVec(v) {
            const [x, y, z, w] = this.quaternion(), q = new v.constructor(x, y, z), t = q.cross(v).multiply(2);
            return v.add(t.multiply(w)).add(q.cross(t));
        }
        multiVec(v) { return this.multVec(v); }  // the name in the standard
        slerp(to, t) {
            const a = this.quaternion();
            let b = to.quaternion(), cosine = a.reduce((sum, c, i) => sum + c * b[i], 0);
            if (cosine < 0) { b = b.map(c => -c); cosine = -cosine; }
            const angle = Math.acos(Math.min(1, cosine)), sine = Math.sin(angle);
            const wa = sine < 1e-9 ? 1 - t : Math.sin((1 - t) * angle) / sine, wb = sine < 1e-9 ? t : Math.sin(t * angle) / sine;
            return Rotation.fromQuaternion(a.map((c, i) => wa * c + wb * b[i]));
        }
    }
    // Row by row; a point is a row from the left, so the translation is the last row (ISO/IEC 19777-1 V3.3 clause 7).
    class Matrix extends Tuple {
        static product(a, b, n) {
            const out = new Array(n * n).fill(0);
            for (let i = 0; i < n; ++i)
                for (let j = 0; j < n; ++j)
                    for (let k = 0; k < n; ++k) out[i * n + j] += a[i * n + k] * b[k * n + j];
            return out;
        }
        /// What the constructor takes besides components: its rows as vectors.
        static rows(given) { return Array.from(given).flatMap(row => row instanceof Tuple ? row.components() : [row]); }
        // Gauss-Jordan with pivots. The inverse is null where there is none.
        static solve(given, n) {
            const m = given.slice(), inverse = Array.from({length: n * n}, (_, i) => i % (n + 1) ? 0 : 1);
            let determinant = 1;
            for (let c = 0; c < n; ++c) {
                let pivot = c;
                for (let r = c + 1; r < n; ++r) if (Math.abs(m[r * n + c]) > Math.abs(m[pivot * n + c])) pivot = r;
                const p = m[pivot * n + c];
                if (p === 0 || !Number.isFinite(p)) return {determinant: 0, inverse: null};
                determinant *= pivot === c ? p : -p;
                for (let k = 0; k < n; ++k)
                    for (const a of [m, inverse]) {
                        const kept = a[c * n + k];
                        a[c * n + k] = a[pivot * n + k] / p;
                        if (pivot !== c) a[pivot * n + k] = kept;
                    }
                for (let r = 0; r < n; ++r) {
                    const factor = m[r * n + c];
                    if (r === c || factor === 0) continue;
                    for (let k = 0; k < n; ++k) { m[r * n + k] -= factor * m[c * n + k]; inverse[r * n + k] -= factor * inverse[c * n + k]; }
                }
            }
            return {determinant, inverse};
        }
        get order() { return Math.sqrt(this.constructor.keys.length); }
        made(numbers) { return new this.constructor(...numbers); }
        assign(numbers) { numbers.forEach((c, i) => { this[i] = c; }); }
        transpose() { const n = this.order, c = this.components(); return this.made(c.map((_, i) => c[i % n * n + Math.trunc(i / n)])); }
        inverse() {
            const {inverse} = Matrix.solve(this.components(), this.order);
            if (!inverse) fail("RangeError", "this matrix has no inverse");
            return this.made(inverse);
        }
        multLeft(m) { return this.made(Matrix.product(m.components(), this.components(), this.order)); }
        multRight(m) { return this.made(Matrix.product(this.components(), m.components(), this.order)); }
        // A vector with one component less than the matrix has rows is a point.
        times(v, entry) {
            const n = this.order, from = v.components(), m = this.components(), isPoint = from.length === n - 1;
            if (!isPoint && from.length !== n) fail("TypeError", `a vector of ${from.length} does not fit this matrix`);
            if (isPoint) from.push(1);
            const out = from.map((_, j) => from.reduce((sum, c, i) => sum + c * entry(m, i, j, n), 0));
            const w = isPoint ? out.pop() : 1;
            return new v.constructor(...out.map(c => c / w));
        }
        multVecMatrix(v) { return this.times(v, (m, i, j, n) => m[i * n + j]); }
        multMatrixVec(v) { return this.times(v, (m, i, j, n) => m[j * n + i]); }
        // A direction: turned and scaled, but not moved.
        direction(v, entry) {
            const n = this.order, from = v.components(), m = this.components();
            if (from.length !== n - 1) fail("TypeError", `a direction of ${from.length} does not fit this matrix`);
            return new v.constructor(...from.map((_, j) => from.reduce((sum, c, i) => sum + c * entry(m, i, j, n), 0)));
        }
        multDirMatrix(v) { return this.direction(v, (m, i, j, n) => m[i * n + j]); }
        multMatrixDir(v) { return this.direction(v, (m, i, j, n) => m[j * n + i]); }
        determinant() { return Matrix.solve(this.components(), this.order).determinant; }
    }
    class Matrix3 extends Matrix {
        det3() { return this.determinant(); }
        // In the plane, angles in radians; what is left out does nothing.
        setTransform(translation, rotation, scale, scaleOrientation, center) {
            const moved = (v, sign) => [1, 0, 0, 0, 1, 0, sign * v.x, sign * v.y, 1];
            const turned = angle => { const c = Math.cos(angle), s = Math.sin(angle); return [c, s, 0, -s, c, 0, 0, 0, 1]; };
            const parts = [];
            if (center) parts.push(moved(center, -1));
            if (scaleOrientation && scale) parts.push(turned(-scaleOrientation));
            if (scale) parts.push([scale.x, 0, 0, 0, scale.y, 0, 0, 0, 1]);
            if (scaleOrientation && scale) parts.push(turned(scaleOrientation));
            if (rotation) parts.push(turned(rotation));
            if (center) parts.push(moved(center, 1));
            if (translation) parts.push(moved(translation, 1));
            const whole = parts.reduce((product, part) => Matrix.product(product, part, 3), moved({x: 0, y: 0}, 1));
            this.assign(whole);
        }
        // Fills in the vectors that are given; of a rotation cosine, sine and angle. Exact for what has no shear.
        getTransform(translation, rotation, scale) {
            const [a, b, , c, d, , x, y] = this.components(), angle = Math.atan2(b, a);
            if (translation) { translation.x = x; translation.y = y; }
            if (rotation) { rotation.x = Math.cos(angle); rotation.y = Math.sin(angle); rotation.z = angle; }
            if (scale) { scale.x = Math.hypot(a, b); scale.y = Math.hypot(c, d) * (a * d - b * c < 0 ? -1 : 1); }
        }
    }
    class Matrix4 extends Matrix {
        det4() { return this.determinant(); }
        det3() { const c = this.components(); return Matrix.solve([0, 1, 2, 4, 5, 6, 8, 9, 10].map(i => c[i]), 3).determinant; }
        // As Transform has them; what is left out does nothing.
        setTransform(translation, rotation, scale, scaleOrientation, center) {
            const moved = (v, sign) => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, sign * v.x, sign * v.y, sign * v.z, 1];
            const turned = r => {
                const rows = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(axis => r.multVec(new names.SFVec3d(...axis)).components());
                return [...rows[0], 0, ...rows[1], 0, ...rows[2], 0, 0, 0, 0, 1];
            };
            const parts = [];
            if (center) parts.push(moved(center, -1));
            if (scaleOrientation && scale) parts.push(turned(scaleOrientation.inverse()));
            if (scale) parts.push([scale.x, 0, 0, 0, 0, scale.y, 0, 0, 0, 0, scale.z, 0, 0, 0, 0, 1]);
            if (scaleOrientation && scale) parts.push(turned(scaleOrientation));
            if (rotation) parts.push(turned(rotation));
            if (center) parts.push(moved(center, 1));
            if (translation) parts.push(moved(translation, 1));
            const whole = parts.reduce((product, part) => Matrix.product(product, part, 4), moved({x: 0, y: 0, z: 0}, 1));
            this.assign(whole);
        }
        // Fills in the objects that are given. Exact for what has no shear.
        getTransform(translation, rotation, scale) {
            const c = this.components(), row = i => new names.SFVec3d(c[4 * i], c[4 * i + 1], c[4 * i + 2]);
            const lengths = [0, 1, 2].map(i => row(i).length());
            if (this.det3() < 0) lengths[2] = -lengths[2];
            if (translation) { translation.x = c[12]; translation.y = c[13]; translation.z = c[14]; }
            if (scale) { scale.x = lengths[0]; scale.y = lengths[1]; scale.z = lengths[2]; }
            if (!rotation) return;
            const [x, y, z] = [0, 1, 2].map(i => lengths[i] === 0 ? row(i) : row(i).divide(lengths[i]));
            // Of the four ways to a quaternion, the one with the largest divisor.
            const squares = [x.x - y.y - z.z, y.y - x.x - z.z, z.z - x.x - y.y, x.x + y.y + z.z];
            const best = squares.indexOf(Math.max(...squares)), s = 2 * Math.sqrt(Math.max(0, 1 + squares[best]));
            const q = best === 0 ? [s / 4, (x.y + y.x) / s, (z.x + x.z) / s, (y.z - z.y) / s]
                : best === 1 ? [(x.y + y.x) / s, s / 4, (y.z + z.y) / s, (z.x - x.z) / s]
                : best === 2 ? [(z.x + x.z) / s, (y.z + z.y) / s, s / 4, (x.y - y.x) / s]
                : [(y.z - z.y) / s, (z.x - x.z) / s, (x.y - y.x) / s, s / 4];
            const found = Rotation.fromQuaternion(q);
            rotation.x = found.x; rotation.y = found.y; rotation.z = found.z; rotation.angle = found.angle;
        }
    }

    // What a program calls to make one, with `new` or without.
    function publishClass(name, made) {
        const maker = {[name]: function (...given) { return Reflect.construct(made, given, new.target ?? maker); }}[name];
        Object.setPrototypeOf(maker, made);  // for what is asked of the class
        maker.prototype = made.prototype;
        Object.defineProperty(made.prototype, "constructor", {value: maker, writable: true, configurable: true, enumerable: false});
        names[name] = maker;
    }
    // Written out for each class, which is several times as fast as a loop over its components. What is assigned to a
    // component becomes a number; of matrices, which have too many, when it is used.
    // `zero`: what the type has by default; `missing`: what the constructor takes for components that are not given.
    function defineTuple(code, name, base, keys, zero = keys.map(() => 0), missing = zero) {
        const isMatrix = base.prototype instanceof Matrix, parts = keys.map(key => Symbol(key));
        const parameters = keys.map((_, i) => `a${i}`), each = (f, between) => keys.map(f).join(between);
        const special = base === Rotation ? "if (a0 instanceof Vector3) { [a0, a1, a2, a3] = Rotation.given(a0, a1); count = 4; }"
            : isMatrix ? `if (count > 1 && a0 instanceof Tuple) { const from = Matrix.rows(arguments); count = from.length; [${parameters}] = from; }` : "";
        const symbols = isMatrix ? "" : `const ${each((_, i) => `s${i} = parts[${i}]`, ", ")};`, part = (key, i) => isMatrix ? `[${key}]` : `[s${i}]`;
        const made = new Function("Tuple", "Vector3", "Rotation", "Matrix", "parts", `"use strict"; ${symbols} return function ${name}(${parameters}) {
            if (new.target === undefined) return Reflect.construct(${name}, arguments);
            let count = arguments.length;
            ${special}
            if (count === 1 && a0 instanceof Tuple) { const from = a0.components(); count = from.length; [${parameters}] = from; }
            ${each((key, i) => `this${part(key, i)} = count > ${i} ? Number(a${i}) : ${missing[i]};`, " ")}
        }`)(Tuple, Vector3, Rotation, Matrix, parts);
        made.keys = keys;
        made.zero = zero;
        spares.set(code, new Float64Array(keys.length));
        made.prototype = Object.create(base.prototype);
        const define = (holder, key, parts) => Object.defineProperty(holder, key, {configurable: true, ...parts});
        const from = each((_, i) => `flat[at + ${i}]`, ", ");
        const written = text => new Function("parts", `"use strict"; ${symbols} return ${text};`)(parts);
        /// From and to plain numbers.
        made.load = new Function("made", `return (flat, at) => new made(${from});`)(made);
        made.store = written(`(value, out, at) => { ${each((key, i) => `out[at + ${i}] = value${part(key, i)};`, " ")} }`);
        const components = each((key, i) => isMatrix ? `Number(this${part(key, i)})` : `this${part(key, i)}`, ", ");
        define(made.prototype, "components", {value: written(`function components() { return [${components}]; }`), writable: true});
        define(made.prototype, "constructor", {value: made, writable: true});
        if (!isMatrix)
            keys.forEach((key, i) => {
                const part = parts[i], accessors = {get() { return this[part]; }, set(value) { this[part] = Number(value); }};
                define(made.prototype, key, {...accessors, enumerable: true});
                define(made.prototype, i, accessors);
            });
        tuples.set(code, made);
        names[name] = made;
    }
    defineTuple(14, "SFColor", Color, ["r", "g", "b"]);
    defineTuple(16, "SFColorRGBA", Color, ["r", "g", "b", "a"]);
    defineTuple(20, "SFVec2f", Vector, ["x", "y"]);
    defineTuple(22, "SFVec2d", Vector, ["x", "y"]);
    defineTuple(24, "SFVec3f", Vector3, ["x", "y", "z"]);
    defineTuple(26, "SFVec3d", Vector3, ["x", "y", "z"]);
    defineTuple(28, "SFVec4f", Vector, ["x", "y", "z", "w"]);
    defineTuple(30, "SFVec4d", Vector, ["x", "y", "z", "w"]);
    defineTuple(SFRotation, "SFRotation", Rotation, ["x", "y", "z", "angle"], [0, 0, 1, 0], [0, 1, 0, 0]);
    [[34, "SFMatrix3f", 3], [36, "SFMatrix3d", 3], [38, "SFMatrix4f", 4], [40, "SFMatrix4d", 4]].forEach(([code, name, n]) =>
        defineTuple(code, name, n === 3 ? Matrix3 : Matrix4, Array.from({length: n * n}, (_, i) => String(i)),
                    Array.from({length: n * n}, (_, i) => i % (n + 1) ? 0 : 1)));

    // Matrices that are no field's value, whose elements are m[row][column].
    const cells = new WeakMap();
    const row = (numbers, n, i) => Object.defineProperties({}, Object.fromEntries(Array.from({length: n}, (_, j) => [j, {
        enumerable: true, get: () => numbers[i * n + j], set: value => { numbers[i * n + j] = Number(value); }}]).concat([["length", {value: n}]])));
    function defineRows(name, base, n) {
        const made = {[name]: class extends base {
            constructor(...given) {
                super();
                const from = given.length === 1 && given[0] instanceof Tuple ? given[0].components() : Matrix.rows(given);
                cells.set(this, Array.from({length: n * n}, (_, i) => i < from.length ? Number(from[i]) : i % (n + 1) ? 0 : 1));
            }
            components() { return cells.get(this).slice(); }
            assign(numbers) { const own = cells.get(this); numbers.forEach((c, i) => { own[i] = c; }); }
            get order() { return n; }
        }}[name];
        for (let i = 0; i < n; ++i)
            Object.defineProperty(made.prototype, i, {
                get() { return row(cells.get(this), n, i); },
                set(given) {
                    const numbers = given instanceof Tuple ? given.components() : Array.from(given, Number);
                    if (numbers.length !== n) fail("TypeError", `a row of ${name} has ${n} numbers`);
                    numbers.forEach((c, j) => { cells.get(this)[i * n + j] = c; });
                },
            });
        publishClass(name, made);
    }
    defineRows("X3DMatrix3", Matrix3, 3);
    defineRows("X3DMatrix4", Matrix4, 4);
    defineRows("VrmlMatrix", Matrix4, 4);  // ISO/IEC 14772-1 C.6.19

    const mfNames = ["Bool", "Int32", "Float", "Double", "Time", "String", "Node", "Color", "ColorRGBA", "Image", "Vec2f", "Vec2d",
                     "Vec3f", "Vec3d", "Vec4f", "Vec4d", "Rotation", "Matrix3f", "Matrix3d", "Matrix4f", "Matrix4d", "Custom"];
    function indexOf(key) {
        if (typeof key !== "string" || key > ":") return -1;  // names of methods come after all digits
        const index = key >>> 0;
        return `${index}` === key ? index : -1;
    }
    const slot = {value: undefined, writable: true, enumerable: true, configurable: true};
    // Nothing of it stays here: a node would seem to be held.
    function put(array, key, value) {
        slot.value = value;
        const done = Reflect.defineProperty(array, key, slot);
        slot.value = undefined;
        return done;
    }
    const wholes = new WeakMap();    // what a program is given instead of a list, or of an output of its own -> that
    const keepers = new WeakMap();   // the same -> its Guard
    const wholeOf = value => isObject(value) ? wholes.get(value) ?? value : value;
    /// What a program is given instead of a list: what it assigns becomes of the list's type at once (19777-1 6.2).
    class Guard {
        constructor(code, isField) { this.code = code; this.isField = isField; }
        wrap(value) {
            const given = new Proxy(value, this);
            wholes.set(given, value);
            keepers.set(given, this);
            return given;
        }
        push(target, values) {
            for (const value of values) put(target, target.length, converted(this.code - 1, value, this.isField));
            return target.length;
        }
        set(target, key, value) {
            const index = indexOf(key);
            if (index < 0) return Reflect.set(target, key, value);
            const kept = converted(this.code - 1, value, this.isField);
            if (index >= target.length) return put(target, key, kept);
            target[index] = kept;
            return true;
        }
        defineProperty(target, key, what) {
            if ("value" in what && indexOf(key) >= 0) what.value = converted(this.code - 1, what.value, this.isField);
            return Reflect.defineProperty(target, key, what);
        }
    }
    const guards = mfNames.map((_, i) => new Guard(2 * i + 1, false)), fieldGuards = mfNames.map((_, i) => new Guard(2 * i + 1, true));
    const isList = code => (code & 1) === 1;

    const imageParts = ["width", "height", "comp", "array"].map(name => Symbol(name)), [kArray] = imageParts.slice(3);
    class SFImage_ {
        constructor(width = 0, height = 0, comp = 0, array = []) {
            this.width = width; this.height = height; this.comp = comp; this.array = array;
        }
        get array() { return this[kArray]; }
        set array(given) { this[kArray] = new names.MFInt32(...Array.from(given)); }
        toString() { return [this.width, this.height, this.comp, ...this.array].join(" "); }
        toVRMLString() { return this.toString(); }
        toXMLString() { return this.toString(); }
        toJSONString() { return jsonOf([this.width, this.height, this.comp, ...this.array]); }
        equals(other) { return other instanceof SFImage_ && this.toString() === other.toString(); }
        toJSON() { return {width: this.width, height: this.height, comp: this.comp, array: Array.from(this.array)}; }
    }
    ["width", "height", "comp"].forEach((name, i) => {
        const part = imageParts[i], accessors = {get() { return this[part]; }, set(value) { this[part] = converted(SFInt32, value, true); }, configurable: true};
        Object.defineProperty(SFImage_.prototype, name, {...accessors, enumerable: true});
        if (i < 2) Object.defineProperty(SFImage_.prototype, "xy"[i], accessors);  // the names in the standard
    });
    publishClass("SFImage", SFImage_);

    const escaped = text => text.replace(/[&<>']/g, one => ({"&": "&amp;", "<": "&lt;", ">": "&gt;", "'": "&apos;"})[one]);
    class MF extends Array {
        constructor(...elements) {
            super();
            const {code} = new.target;
            for (const element of elements) put(this, this.length, converted(code - 1, element, false));
            return guards[code >> 1].wrap(this);
        }
        static get [Symbol.species]() { return Array; }
        toString() { return "[" + this.join(", ") + "]"; }
        toVRMLString() { return this.toString(); }
        toXMLString() {
            return Array.from(this, one => typeof one === "string" ? escaped(jsonOf(one)) : one?.toXMLString ? one.toXMLString() : String(one)).join(", ");
        }
        toJSONString() {
            return "[" + Array.from(this, one => {
                const text = one?.toJSONString ? one.toJSONString() : jsonOf(one);
                return one instanceof Tuple || one instanceof SFImage_ ? text.slice(1, -1) : text;
            }).join(", ") + "]";
        }
        equals(other) {
            return Array.isArray(other) && other.length === this.length && Array.from(this).every((one, i) => one?.equals ? one.equals(other[i]) : one === other[i]);
        }
    }
    // An element that was never given, before one that was assigned far beyond the end, is what the type has by default.
    // Only what neither an element nor a method answers comes here.
    for (const key of Reflect.ownKeys(Array.prototype))
        if (!Object.hasOwn(MF.prototype, key)) Object.defineProperty(MF.prototype, key, Object.getOwnPropertyDescriptor(Array.prototype, key));
    // The engine's own would look behind the proxies for every element.
    MF.prototype.push = function push(...given) { return keepers.get(this).push(wholes.get(this), given); };
    // What is not known here the program's own Array.prototype may know.
    const beyond = () => native.global().Array.prototype;
    Object.setPrototypeOf(MF.prototype, new Proxy({}, {
        get(target, key, receiver) {
            const index = indexOf(key);
            if (index < 0 || !Array.isArray(receiver) || index >= receiver.length) return Reflect.get(beyond(), key, receiver);
            const value = receiver.constructor.filler();
            put(wholeOf(receiver), key, value);
            return value;
        },
        set(target, key, value, receiver) {
            return put(receiver, key, value);
        },
        has: (target, key) => Reflect.has(beyond(), key),
        getPrototypeOf: beyond,
        setPrototypeOf: () => false, defineProperty: () => false, deleteProperty: () => false, preventExtensions: () => false,
    }));
    mfNames.forEach((name, i) => {
        const made = {["MF" + name]: class extends MF {}}["MF" + name];
        const element = 2 * i;
        made.code = element + 1;
        made.filler = () => {
            const tuple = tuples.get(element);
            return tuple ? new tuple(...tuple.zero) : element === SFString ? "" : element === SFNode ? null : element === SFImage ? new SFImage_()
                : element === 0 ? false : 0;
        };
        if (element === SFString)  // as a file has it
            made.prototype.toString = function () { return "[" + Array.from(this, text => `"${String(text).replace(/["\\]/g, "\\$&")}"`).join(", ") + "]"; };
        arrays.set(element + 1, made);
        if (element !== SFCustom) publishClass("MF" + name, made);  // what a program calls it, its type says
    });

    // ---- to and from the plain form that crosses the bridge: numbers, strings, Float64Array, arrays of strings ----
    const typeName = code => (code & 1 ? "MF" : "SF") + mfNames[code >> 1];
    function refuse(code, value) {
        const what = value === null ? "null" : ids.has(value) ? native.typeName(ids.get(value))
            : typeof value === "object" ? value.constructor?.name ?? "object" : typeof value;
        fail("TypeError", `${typeName(code)} cannot hold ${what}`);
    }
    function scalar(code, value) {
        if (code === 0) return value ? 1 : 0;
        if (code === SFNode) {
            if (value === null || value === undefined) return 0;
            const id = ids.get(value);
            return id === undefined ? refuse(code, value) : id;
        }
        const number = numberOf(code, value);
        return code === SFInt32 ? number | 0 : number;
    }
    /// As ECMAScript makes numbers of boolean values and texts; what says no number is an error.
    function numberOf(code, value) {
        if (typeof value === "number") return value;
        const isNumeric = typeof value === "boolean" || typeof value === "bigint" || typeof value === "string" && value.trim() !== "";
        const number = isNumeric ? Number(value) : NaN;
        return number === number ? number : refuse(code, value);
    }
    function tupleInto(code, tuple, value, out, at) {
        if (value instanceof tuple) return tuple.store(value, out, at);
        const keys = tuple.keys, source = value instanceof Tuple ? value.components() : Array.isArray(value) ? value : refuse(code, value);
        if (source.length !== keys.length) refuse(code, value);
        for (let i = 0; i < keys.length; ++i) out[at + i] = Number(source[i]);
    }
    /// What a value becomes that is assigned to an element of type `code`. What is assigned to a field is copied.
    function converted(code, given, isField) {
        const value = wholeOf(given), tuple = tuples.get(code);
        if (tuple) {
            if (value instanceof tuple && !isField) return value;
            const spare = spares.get(code);
            if (value === undefined) spare.set(tuple.zero); else tupleInto(code, tuple, value, spare, 0);
            return tuple.load(spare, 0);
        }
        if (code === SFString) return value === undefined ? "" : String(value);
        if (code === SFCustom) return revive(code, flatten(code, value));
        if (code === SFImage) return value instanceof SFImage_ ? value : refuse(code, value);
        if (code === SFNode) return scalar(code, value) === 0 ? null : value;
        const number = value === undefined ? 0 : scalar(code, value);
        return code === 0 ? number !== 0 : number;
    }
    /// Types from outside: a number, an array of numbers or a text, which is replaced as a whole.
    function customForm(value) {
        if (typeof value === "number" || typeof value === "string") return value;
        if (!Array.isArray(value)) refuse(SFCustom, value);
        return Float64Array.from(Array.from(value, one => numberOf(SFCustom, one)));
    }
    function imageWords(value) {
        if (!(value instanceof SFImage_)) refuse(SFImage, value);
        return [value.width, value.height, value.comp, ...value.array];
    }
    /// `spare`: an array of the right length that may be used again.
    function flatten(code, value, spare) {
        if (!(code & 1)) {
            if (code === SFString) return String(value);
            if (code === SFCustom) return customForm(value);
            if (code === SFImage) return Float64Array.from(imageWords(value));
            const tuple = tuples.get(code);
            if (!tuple) return scalar(code, value);
            const out = spare ?? new Float64Array(tuple.keys.length);
            tupleInto(code, tuple, value, out, 0);
            return out;
        }
        const element = code - 1;
        value = wholeOf(value);
        if (value === null || typeof value !== "object" || typeof value.length !== "number") value = [value];
        if (element === SFString) return Array.from(value, text => text === undefined ? "" : String(text));
        if (element === SFCustom) return Array.from(value, customForm);
        if (element === SFImage) return Float64Array.from(Array.from(value).flatMap(imageWords));
        const tuple = tuples.get(element), width = tuple ? tuple.keys.length : 1, out = new Float64Array(value.length * width);
        for (let i = 0; i < value.length; ++i) {
            if (!tuple) out[i] = value[i] === undefined ? 0 : scalar(element, value[i]);
            else if (value[i] === undefined) out.set(tuple.zero, i * width);
            else tupleInto(element, tuple, value[i], out, i * width);
        }
        return out;
    }
    /// `nodeOf`: the program's own object for a node.
    function revive(code, flat, nodeOf) {
        if (!(code & 1)) {
            if (code === 0) return flat !== 0;
            if (code === SFNode) return nodeOf(flat);
            if (code === SFCustom) return isObject(flat) ? Object.freeze(ownArray(flat)) : flat;
            if (code === SFImage) return flat.length < 3 ? new SFImage_() : new SFImage_(flat[0], flat[1], flat[2], flat.subarray(3));
            const tuple = tuples.get(code);
            return tuple ? tuple.load(flat, 0) : flat;
        }
        const element = code - 1, result = [], tuple = tuples.get(element);
        if (element === SFImage) {
            for (let at = 0; at + 3 <= flat.length;) {
                const words = flat[at] * flat[at + 1];
                result.push(revive(SFImage, flat.subarray(at, at + 3 + words)));
                at += 3 + words;
            }
        } else if (tuple) {
            const width = tuple.keys.length;
            for (let at = 0; at < flat.length; at += width) result.push(tuple.load(flat, at));
        } else {
            for (let i = 0; i < flat.length; ++i) result.push(element === SFString ? flat[i] : revive(element, flat[i], nodeOf));
        }
        Object.setPrototypeOf(result, arrays.get(code).prototype);
        return result;
    }

    /// The same, as a program is given it.
    function offered(code, flat, nodeOf) {
        const value = revive(code, flat, nodeOf);
        return isList(code) ? fieldGuards[code >> 1].wrap(value) : value;
    }

    /// The plain form of a field's value.
    function plain(field, value) {
        if (field.tuple === undefined || !(value instanceof field.tuple)) return flatten(field.code, value, field.spare);
        field.tuple.store(value, field.spare, 0);
        return field.spare;
    }
    /// The same; of what is no such value `tell` hears why, and it is undefined.
    function plainOr(field, value, tell) {
        try {
            return plain(field, value);
        } catch (error) {
            tell?.(String(error?.message ?? error));
            return undefined;
        }
    }
    /// Numbers, strings and nodes cannot be changed in place.
    const changesInPlace = code => isList(code) || code === SFImage || tuples.has(code);
    /// Of two plain forms of one type.
    function isAlike(a, b) {
        if (a === undefined || b === undefined || a.length !== b.length) return false;
        for (let i = 0; i < a.length; ++i) if (a[i] !== b[i] && (a[i] === a[i] || b[i] === b[i])) return false;
        return true;
    }
    /// Makes a value the same as another of its type.
    function refill(value, from) {
        if (!Array.isArray(value)) return void Object.assign(value, from);
        value.length = 0;
        for (let i = 0; i < from.length; ++i) put(value, i, from[i]);
    }
    /// What an assignment keeps: later changes of `value` are not meant.
    function copied(field, value, nodeOf) {
        const flat = plain(field, value);
        return field.tuple === undefined ? revive(field.code, flat, nodeOf) : field.tuple.load(flat, 0);
    }

    // ---- outputs in place ----------------------------------------------------------------------------------------
    /// What a program is given of an output of its own: every assignment in it makes its cell one that has been assigned,
    /// also of what is there already. Once its call is over it is a value like others.
    const watching = Base => class extends Base {
        constructor(cell, code) {
            super(code, true);
            this.cell = cell;
            this.value = cell.value;
        }
        push(target, values) { return this.told(super.push(target, values)); }
        set(target, key, value) { return this.told(super.set(target, key, value)); }
        defineProperty(target, key, what) { return this.told(super.defineProperty(target, key, what)); }
        deleteProperty(target, key) { return this.told(Reflect.deleteProperty(target, key)); }
        told(done) {
            if (this.cell.value === this.value) this.cell.assigned = true;
            return done;
        }
    };
    const WatchList = watching(Guard);
    const Watch = watching(class {
        wrap(value) { return Guard.prototype.wrap.call(this, value); }
        set(target, key, value) { return Reflect.set(target, key, target instanceof Matrix && indexOf(key) >= 0 ? Number(value) : value); }
        defineProperty(target, key, what) { return Reflect.defineProperty(target, key, what); }
    });
    /// `parts`: what is in lists of tuples, and in images, can be assigned to as well.
    const withParts = Base => class extends Base {
        constructor(cell, code) { super(cell, code); this.parts = new WeakMap(); }
        get(target, key, receiver) {
            const found = Reflect.get(target, key, receiver);
            if (!isObject(found) || !this.isPart(target, key)) return found;
            let part = this.parts.get(found);
            if (part === undefined) this.parts.set(found, part = this.watchPart(found));
            return part;
        }
    };
    class WatchImage extends withParts(Watch) {
        isPart(target, key) { return key === "array"; }
        watchPart(list) { return new WatchList(this.cell, MFInt32).wrap(wholeOf(list)); }
    }
    class WatchParts extends withParts(WatchList) {
        isPart(target, key) { return Object.hasOwn(target, key); }
        watchPart(value) { return this.code - 1 === SFImage ? new WatchImage(this.cell, SFImage).wrap(value) : (this.inner ??= new Watch(this.cell, this.code - 1)).wrap(value); }
    }
    function watched(cell) {
        const {code} = cell.field;
        const Kind = code === SFImage ? WatchImage : !isList(code) ? Watch : code - 1 === SFImage || tuples.has(code - 1) ? WatchParts : WatchList;
        return new Kind(cell, code).wrap(cell.value);
    }

    // ---- nodes, and what prints ----------------------------------------------------------------------------------
    const inputOnly = 1, outputOnly = 2, inputOutput = 3, mostSpare = 64, mostFields = 4096, touchedBits = 24, ids = new WeakMap(), fields = new Map();
    class SFNode_ {
        /// As in VRML97: the first node of a text.
        constructor(text = "") { return native.global().Browser.createVrmlFromString(String(text))[0] ?? fail("TypeError", "SFNode: the text has no node"); }
    }
    publishClass("SFNode", SFNode_);
    const methods = {
        getTypeName: id => native.typeName(id), getNodeTypeName: id => native.typeName(id), getNodeName: id => native.nodeName(id),
        getName: id => native.nodeName(id), toString: id => `${native.typeName(id)} { }`, valueOf: id => id,
        equals: (id, other) => isObject(other) && ids.get(other) === id,
        dispose(id) { const flaw = native.dispose(id); if (typeof flaw === "string") fail("Error", flaw); },
    };
    for (const [name, method] of Object.entries(library.nodeMethods)) methods[name] = id => method(id, {ownArray});
    function idOf(node) {
        const id = typeof node === "object" && node !== null ? ids.get(node) : undefined;
        if (id === undefined) fail("TypeError", "a node is expected here");
        return id;
    }
    const text = given => given.map(String).join(" ");
    const print = (...given) => native.print(text(given));
    const println = (...given) => native.print(text(given) + "\n");
    Object.assign(names, {
        print: println, trace: println, TRUE: true, FALSE: false, X3DConstants: library.constants,
        ...library.kinds,
        console: {log: println, info: println, debug: println, warn: println, error: println},
    });

    /// A field as its type has it. Of those that are alike there is one for all programs: a thousand of them, each called
    /// once a frame, wait for memory more than they compute.
    function sharedField(packed, name) {
        const key = `${packed} ${name}`, known = fields.get(key);
        if (known !== undefined) return known;
        if (fields.size >= mostFields) fields.clear();
        const code = packed >> 16 & 0xFF;
        const access = packed >> 24, changes = changesInPlace(code);
        const field = {index: packed & 0xFFFF, place: (packed & 0xFFFF) % touchedBits, code, access, name, tuple: tuples.get(code),
                       spare: spares.get(code), changes, sentInPlace: changes && (access === outputOnly || access === inputOutput)};
        fields.set(key, field);
        return field;
    }

    // ---- a program: its nodes and their fields ---------------------------------------------------------------------
    /// `self`: the Script's number; `global`: the program's global object.
    function program(self, global) {
        // What this call has touched, in this order; what has been assigned anew since has null in its first place.
        // Lists keep their length: to shorten one costs as much as a call.
        let order = [], count = 0, spareOrder = null, hasOthers = false;
        // One value each, and its place in the order or -1. `base`: in the plain form as it was read or sent, for what can be
        // changed in place; `given`: the program has had the object; `shown`: what it has had, where that is watched; `age`:
        // the flush after which it was compared with the scene. The Script's own by index.
        const own = [], others = new Map();
        let age = 0, depth = 0, atEnd;
        // Which of its own fields have a cell in that order, a bit each, or several that share one: readers look here.
        const touched = new Float64Array(1);
        const proxies = new Map(), fieldTables = new Map();

        function fieldOf(id, name) {
            if (typeof name !== "string") return undefined;
            const type = native.type(id);
            let table = fieldTables.get(type);
            if (!table) fieldTables.set(type, table = new Map());
            let field = table.get(name);
            if (field === undefined) {
                const packed = native.field(id, name);
                table.set(name, field = packed < 0 ? null : sharedField(packed, name));
            }
            return field;
        }
        function cellOf(id, field) {
            const key = id === self ? field.index : id * 65536 + field.index;
            let cell = id === self ? own[key] : others.get(key);
            if (cell === undefined) {
                cell = {id, field, value: undefined, shown: undefined, base: undefined, assigned: false, given: false, at: -1, age: 0};
                if (id === self) own[key] = cell; else others.set(key, cell);
                hasOthers ||= id !== self;
            }
            return cell;
        }
        function line(cell) {
            cell.at = count;
            order[count++] = cell;
            if (cell.id === self) touched[0] |= 1 << cell.field.place;
        }
        function drop(cell) {
            cell.at = -1;
            cell.value = cell.shown = cell.base = undefined;
        }
        /// What the object says is what the scene says, unless the program has changed it since.
        function renew(cell) {
            const {field, value, base} = cell;
            cell.age = age;
            if (cell.assigned || !isAlike(plainOr(field, value, undefined), base)) return;
            const flat = native.read(cell.id, field.index);
            if (isAlike(flat, base)) return;
            cell.base = flat;
            refill(value, revive(field.code, flat, nodeOf));
        }
        function valueOf(cell) {
            const {field} = cell;
            if (cell.at < 0) {
                const flat = native.read(cell.id, field.index);
                cell.value = revive(field.code, flat, nodeOf);
                cell.base = field.changes ? flat : undefined;
                cell.assigned = false;
                cell.age = age;
                line(cell);
            } else if (cell.age !== age) {
                renew(cell);
            }
            cell.given = field.changes;
            if (cell.id === self && field.sentInPlace) return cell.shown ??= watched(cell);
            return isList(field.code) ? cell.shown ??= fieldGuards[field.code >> 1].wrap(cell.value) : cell.value;
        }
        function assignTo(cell, value) {
            const kept = copied(cell.field, value, nodeOf);
            if (cell.at >= 0) order[cell.at] = null;
            cell.value = kept;
            cell.shown = cell.base = undefined;
            cell.assigned = true;
            cell.given = false;
            cell.age = age;
            line(cell);
        }
        /// Nodes that the field cannot hold are an error at the program's own line. What is on its way may make room.
        function checkNodes(id, field, value) {
            const flat = plain(field, value);
            let flaw = native.mayHold(id, field.index, flat);
            if (flaw && count > 0) {
                flush(false);
                flaw = native.mayHold(id, field.index, flat);
            }
            if (flaw) fail("TypeError", `${field.name}: ${flaw}`);
        }
        const read = (id, field) => field.access === inputOnly ? undefined : valueOf(cellOf(id, field));
        function assign(id, field, value) {
            // Its own fields, but for inputs, a program may always write.
            const flaw = id === self && field.access !== inputOnly ? undefined : native.mayWrite(self, id, field.index);
            if (flaw) fail("TypeError", `${field.name}: ${flaw}`);
            if (id !== self && (field.code | 1) === MFNode) checkNodes(id, field, value);
            assignTo(cellOf(id, field), value);
        }
        const nodeHandler = {
            get(target, name) {
                if (!native.exists(target.id)) fail("ReferenceError", "this node has been destroyed");
                const field = fieldOf(target.id, name);
                if (field) return read(target.id, field);
                if (name === Symbol.toPrimitive) return () => `${native.typeName(target.id)} { }`;
                return Object.hasOwn(methods, name) ? given => methods[name](target.id, given) : undefined;
            },
            set(target, name, value) {
                if (!native.exists(target.id)) fail("ReferenceError", "this node has been destroyed");
                const field = fieldOf(target.id, name);
                if (!field) fail("TypeError", `${native.typeName(target.id)} has no field ${String(name)}`);
                assign(target.id, field, value);
                return true;
            },
            has(target, name) { return !!fieldOf(target.id, name); },
            ownKeys(target) { return native.exists(target.id) ? native.fieldsOf(target.id)[0] : []; },
            getOwnPropertyDescriptor(target, name) {
                if (!native.exists(target.id) || !fieldOf(target.id, name)) return undefined;
                return {get: () => this.get(target, name), set: value => { this.set(target, name, value); }, enumerable: true, configurable: true};
            },
            getPrototypeOf() { return SFNode_.prototype; },
        };
        function nodeOf(id) {
            if (!id) return null;
            let proxy = proxies.get(id);
            if (!proxy) {
                proxies.set(id, proxy = new Proxy({id}, nodeHandler));
                ids.set(proxy, id);
            }
            return proxy;
        }
        function tell(id, field, why) {
            const whose = id === self ? "" : `${native.typeName(id)} ${native.nodeName(id) || id}.`;
            native.warn(self, `${whose}${field.name}: ${why}`);
        }
        function send(id, field, flat, assigned) {
            const flaw = native.write(self, id, field.index, flat, assigned);
            if (flaw) tell(id, field, flaw);
        }
        /// The plain form of what is to be sent; undefined if there is nothing.
        function news(cell) {
            const {id, field, value, base, assigned} = cell;
            if (!assigned && !field.changes) return undefined;
            const flat = plainOr(field, value, why => tell(id, field, why));
            return assigned || (flat !== undefined && !isAlike(flat, base)) ? flat : undefined;
        }
        /// `last`: the call is over, and what it has touched is forgotten. Else what the program holds stays the
        /// fields', and what it has not touched since the flush before is looked at when the call is over.
        function flush(last) {
            if (count === 0) return;
            const before = age++;
            touched[0] = 0;
            if (last && count === 1) {
                const cell = order[0], {id, field, assigned} = cell;
                order[0] = null;
                count = 0;
                const flat = news(cell);
                drop(cell);
                if (hasOthers) others.clear(), hasOthers = false;
                if (flat !== undefined) send(id, field, flat, assigned);
                return;
            }
            // A write may call this program again: it must not find what is on its way. Mostly that is one value.
            const pending = order, end = count;
            order = spareOrder ?? [];
            count = 0;
            spareOrder = null;
            let rest = null;
            for (let i = 0; i < end; ++i) {
                const cell = pending[i];
                if (cell === null) continue;
                pending[i] = null;
                if (!last && !cell.assigned && cell.age !== before) {
                    line(cell);
                    continue;
                }
                const {id, field, assigned, given} = cell;
                let flat = news(cell);
                if (flat !== undefined) {
                    if (flat === field.spare) flat = flat.slice();
                    (rest ??= []).push({id, field, flat, assigned});
                    cell.base = flat;
                }
                cell.assigned = false;
                if (!last && given) line(cell); else drop(cell);
            }
            if (last && hasOthers) others.clear(), hasOthers = false;
            if (end <= mostSpare) spareOrder = pending;
            if (rest !== null) for (const {id, field, flat, assigned} of rest) send(id, field, flat, assigned);
        }
        function publish(name, value) {
            Object.defineProperty(global, name, {value, writable: true, configurable: true, enumerable: false});
        }
        // Made when it is first asked for: it is more than all the rest of a program that never does.
        Object.defineProperty(global, "Browser", {
            get() {
                const {browser, tellListeners} = library.makeBrowser({self, nodeOf, idOf, flush: () => flush(false), fail, flatten, offered, ownArray, print, println});
                publish("Browser", browser);
                atEnd = tellListeners;
                return browser;
            },
            set(value) { publish("Browser", value); },
            enumerable: false, configurable: true,
        });

        // ---- the Script's own fields are variables of its program; a function of that name takes the place of one ----
        for (const name of native.fieldNames(self)) {
            const field = fieldOf(self, name);
            if (!field || field.access === inputOnly) continue;
            const cell = cellOf(self, field), get = () => valueOf(cell);
            Object.defineProperty(global, name, {
                get: isNumber(field.code) ? native.reader(field.index, field.place, touched, get) : get,
                /// assignTo() and line() in one, as event() has flush().
                set(value) {
                    const kept = copied(field, value, nodeOf);
                    if (cell.at >= 0) order[cell.at] = null;
                    cell.value = kept;
                    cell.shown = cell.base = undefined;
                    cell.assigned = true;
                    cell.given = false;
                    cell.age = age;
                    cell.at = count;
                    order[count++] = cell;
                    touched[0] |= 1 << field.place;
                },
                enumerable: true, configurable: true,
            });
        }

        // Between two steps in which nothing but a collection of garbage happens: nodes that only their proxies keep.
        let loose = [];
        const handlers = [];
        /// Whether there is such a function; one that `let` or `const` declares is made a property, as others are.
        function has(name) {
            if (typeof Object.getOwnPropertyDescriptor(global, name)?.value === "function") return true;
            const value = native.lexical(name);
            if (typeof value === "function") Object.defineProperty(global, name, {value, writable: true, configurable: true, enumerable: false});
            return typeof value === "function";
        }
        return {
            /// Lets go of nodes that the scene would like to know of.
            loosen() {
                for (let i = 0; i < count; ++i) if (order[i] !== null) drop(order[i]);
                order = [];
                count = 0;
                touched[0] = 0;
                others.clear();
                for (const [id, proxy] of proxies)
                    if (!native.exists(id)) proxies.delete(id);
                    else if (native.isLoose(id)) { loose.push([id, new WeakRef(proxy)]); proxies.delete(id); }
                return loose.length;
            },
            /// Those of them that the program still holds.
            tighten() {
                const held = loose.map(([id, reference]) => [id, reference.deref()]).filter(([id, proxy]) => proxy);
                for (const [id, proxy] of held) proxies.set(id, proxy);
                loose = [];
                return Float64Array.from(held, ([id]) => id);
            },
            has,
            /// What event() calls the function of that name by; -1 if there is none.
            handler: name => has(name) ? handlers.push(name) - 1 : -1,
            call(name, ...given) {
                ++depth;
                try {
                    global[name](...given);
                } finally {
                    flush(--depth === 0);
                }
            },
            shutdown() {
                ++depth;
                try {
                    try {
                        atEnd?.();
                    } finally {
                        if (has("shutdown")) global.shutdown();
                    }
                } finally {
                    flush(--depth === 0);
                }
            },
            /// An event of type `code` for a handler.
            event(handler, code, flat, time) {
                ++depth;
                try {
                    global[handlers[handler]](offered(code, flat, nodeOf), time);
                } finally {
                    if (--depth > 0 || count !== 1 || hasOthers) flush(depth === 0); else {
                        // flush(true) of one cell, as most calls leave it, written out: each function on the way is one
                        // more object of this program that comes from far away.
                        touched[0] = 0;
                        const cell = order[0];
                        count = 0;
                        const {field, value, base, assigned} = cell;
                        cell.at = -1;
                        cell.value = cell.shown = cell.base = undefined;
                        if (assigned || field.changes) {
                            const left = plainOr(field, value, why => tell(self, field, why));
                            if (left !== undefined && (assigned || !isAlike(left, base))) {
                                const flaw = native.write(self, self, field.index, left, assigned);
                                if (flaw) tell(self, field, flaw);
                            }
                        }
                    }
                }
            },
            flush() { flush(depth === 0); },
        };
    }

    // ---- what all programs share none of them can change -----------------------------------------------------------
    /// Everything that can be reached from `roots`, but for the ends of chains that look into the program's own realm.
    function freezeAll(roots) {
        const seen = new Set([native, globalThis]), pending = roots.slice();
        while (pending.length) {
            const one = pending.pop();
            if ((typeof one !== "object" && typeof one !== "function") || one === null || seen.has(one)) continue;
            seen.add(one);
            Object.freeze(one);
            if (one !== MF.prototype) pending.push(Object.getPrototypeOf(one));
            for (const key of Reflect.ownKeys(one)) {
                const {value, get, set} = Object.getOwnPropertyDescriptor(one, key) ?? {};
                pending.push(value, get, set);
            }
        }
    }
    delete Function.prototype.constructor;  // nobody can make code for this realm
    freezeAll([names, library, [][Symbol.iterator](), ""[Symbol.iterator](), new Map()[Symbol.iterator](), /./[Symbol.matchAll](""),
               ...Reflect.ownKeys(globalThis).map(name => globalThis[name])]);
    return {names, program};
})
