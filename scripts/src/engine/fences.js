// What a Script must not take from the machine: chance, the clock, the time zone, the locale, the last bits of its
// arithmetic, and more memory at once than there is for scripts. Two runs of one document agree wherever they run. Source: ECMA-262, 21.4 (Date); ECMA-402.
//
// Evaluated once a thread, in the realm of the prelude; each fence is put up in a program's realm when the program
// first names what it is for (which costs nothing until then). Local time is UTC; the locale is en-US.
(function (native) {
    "use strict";

    function publish(holder, name, value) {
        Object.defineProperty(holder, name, {value, writable: true, configurable: true, enumerable: false});
    }
    const now = () => Math.trunc(native.now() * 1000);

    // ---- chance: seeded by the Script's number -------------------------------------------------------------------
    function chance(global, self) {
        let seed = (self * 2654435761 ^ 0x9E3779B9) >>> 0 || 1;
        publish(global.Math, "random", () => {
            seed ^= seed << 13; seed >>>= 0;
            seed ^= seed >>> 17;
            seed ^= seed << 5; seed >>>= 0;
            return seed / 4294967296;
        });
    }

    // ---- elementary functions: the scene's, which have the same bits everywhere --------------------------------------
    const elementary = Object.getOwnPropertyNames(native.math).map(name => [name, Object.freeze(native.math[name])]);
    function arithmetic(global) {
        for (const [name, f] of elementary) global.Math[name] = f;
    }
    arithmetic(globalThis);
    function mathematics(global, self) {
        arithmetic(global);
        chance(global, self);
    }

    // ---- dates: the engine's own, without its clock and its local time ----------------------------------------------
    const hasZone = /(?:Z|[+-]\d\d:?\d\d|\b(?:GMT|UTC?|[ECMP][SD]T))\s*(?:\(.*\))?\s*$/i;
    const isoDate = /^[+-]?\d{4,6}(?:-\d\d){0,2}$/, isoDateTime = /^[+-]?\d{4,6}(?:-\d\d){0,2}T/;
    const dateText = words => `${words[0].slice(0, 3)} ${words[2]} ${words[1]} ${words[3]}`;
    const timeText = words => `${words[4]} GMT+0000 (UTC)`;
    const inUtc = options => options?.timeZone === undefined ? Object.assign({}, options, {timeZone: "UTC"}) : options;
    function dates(global) {
        const RealDate = global.Date, prototype = RealDate.prototype, parseReal = RealDate.parse;
        /// Milliseconds; a text that names no zone is in UTC.
        function parse(given) {
            const text = String(given);
            if (isoDate.test(text) || hasZone.test(text)) return parseReal(text);
            return parseReal(text + (isoDateTime.test(text) ? "Z" : " UTC"));
        }
        function instant(given) {
            if (given.length === 0) return now();
            if (given.length > 1) return RealDate.UTC(...given);
            const value = given[0] instanceof RealDate ? given[0].getTime() : given[0];
            const primitive = typeof value === "object" && value !== null ? value[Symbol.toPrimitive]?.("default") ?? value.valueOf() : value;
            return typeof primitive === "string" ? parse(primitive) : Number(primitive);
        }
        function Date_(...given) {
            if (!new.target) return new Date_().toString();
            return Reflect.construct(RealDate, [instant(given)], new.target);
        }
        publish(Date_, "name", "Date");
        publish(Date_, "now", () => now());
        publish(Date_, "parse", parse);
        publish(Date_, "UTC", RealDate.UTC);
        Object.defineProperty(Date_, "prototype", {value: prototype, writable: false});
        publish(prototype, "constructor", Date_);
        for (const part of ["FullYear", "Month", "Date", "Day", "Hours", "Minutes", "Seconds", "Milliseconds"]) {
            publish(prototype, "get" + part, prototype["getUTC" + part]);
            if (part !== "Day") publish(prototype, "set" + part, prototype["setUTC" + part]);
        }
        publish(prototype, "getTimezoneOffset", function () { return this.getTime() === this.getTime() ? 0 : NaN; });
        publish(prototype, "getYear", function () { return this.getUTCFullYear() - 1900; });
        publish(prototype, "setYear", function (year) {
            const y = Math.trunc(Number(year));
            return this.setUTCFullYear(y >= 0 && y <= 99 ? y + 1900 : y);
        });
        const valid = (date, f) => date.getTime() === date.getTime() ? f(date.toUTCString().split(" ")) : "Invalid Date";
        publish(prototype, "toDateString", function toDateString() { return valid(this, dateText); });
        publish(prototype, "toTimeString", function toTimeString() { return valid(this, timeText); });
        publish(prototype, "toString", function toString() { return valid(this, words => `${dateText(words)} ${timeText(words)}`); });
        for (const name of ["toLocaleString", "toLocaleDateString", "toLocaleTimeString"]) {
            const real = prototype[name];
            publish(prototype, name, {[name](locales, options) { return real.call(this, locales, inUtc(options)); }}[name]);
        }
        publish(global, "Date", Date_);
    }

    function formats(global) {
        const Intl = global.Intl;
        const Real = Intl.DateTimeFormat, prototype = Real.prototype;
        function DateTimeFormat(locales, options) { return Reflect.construct(Real, [locales, inUtc(options)], new.target ?? Real); }
        Object.defineProperty(DateTimeFormat, "prototype", {value: prototype, writable: false});
        publish(DateTimeFormat, "supportedLocalesOf", Real.supportedLocalesOf);
        publish(prototype, "constructor", DateTimeFormat);
        const format = Object.getOwnPropertyDescriptor(prototype, "format").get, toParts = prototype.formatToParts;
        Object.defineProperty(prototype, "format", {
            get() { const f = format.call(this); return (date = now()) => f(date); }, configurable: true,
        });
        publish(prototype, "formatToParts", function formatToParts(date = now()) { return toParts.call(this, date); });
        publish(Intl, "DateTimeFormat", DateTimeFormat);
    }

    // ---- memory that is taken in one step, before the watch can look ------------------------------------------------
    function reserve(bytes) {
        if (!native.hasRoomFor(bytes))
            throw new (native.global().RangeError)(`out of memory: ${bytes} bytes are more than scripts may hold`);
    }
    function guard(global, name, bytesOf) {
        const Real = global[name], guarded = new Proxy(Real, {
            construct(target, given, newTarget) {
                reserve(bytesOf(given[0], Real));
                return Reflect.construct(target, given, newTarget === guarded ? target : newTarget);
            },
        });
        publish(Real.prototype, "constructor", guarded);
        publish(global, name, guarded);
    }
    const size = value => typeof value === "number" ? value : typeof value === "object" && value !== null ? 0 : Number(value) || 0;
    const typed = ["Int8Array", "Uint8Array", "Uint8ClampedArray", "Int16Array", "Uint16Array", "Int32Array", "Uint32Array",
                   "Float32Array", "Float64Array", "BigInt64Array", "BigUint64Array"];
    // Each leads to the others (`new Uint8Array(1).buffer.constructor`): all at once.
    function buffers(global) {
        guard(global, "ArrayBuffer", size);
        for (const name of typed) guard(global, name, (value, Real) => size(value) * Real.BYTES_PER_ELEMENT);
    }
    // Strings that one call of the engine makes longer, or into more, than what it is given: `bytesOf(text, ...arguments)`
    // is what it may take while it works. Text and numbers are made once, as the engine would. These can be had without
    // a name: they are put up at once, the same functions in all realms.
    const small = 1 << 20, hasRoom = bytes => !(bytes > small) || reserve(bytes);
    const textOf = value => typeof value === "string" ? value : typeof value === "number" ? String(value) : "";
    const guarded = {String: Object.create(null), Array: Object.create(null), global: Object.create(null)};
    function guardText(name, bytesOf, prepare = value => value, check = () => {}) {
        const real = String.prototype[name];
        guarded.String[name] = {[name](...given) {
            if (this === undefined || this === null) return real.apply(this, given);
            const text = String(this);
            if (given.length > 0) given[0] = prepare(given[0]);
            hasRoom(bytesOf(text, ...given));
            check(text, given[0]);
            return real.apply(text, given);
        }}[name];
    }
    const toNumber = value => +value;
    // What takes the square of a text's length is one step, too.
    const refuse = why => { throw new (native.global().RangeError)(why); };
    const isObject = value => value !== null && (typeof value === "object" || typeof value === "function");
    /// An object that does not do the work itself is a text.
    const toText = doer => value => isObject(value) && (doer === undefined || value[doer] === undefined || value[doer] === null) ? `${value}` : value;
    const mostComparisons = 2 ** 31;
    function mustBeQuick(text, part) {
        if (typeof part === "string" && (text.length - part.length + 1) * part.length > mostComparisons)
            refuse(`looking for ${part.length} characters among ${text.length} takes too long`);
    }
    // A run of twice as many holds one that begins at a multiple; a pair of surrogates may be cut at its ends.
    const manyMarks = 4096, allMarks = /^[\udc00-\udfff]?\p{M}+[\ud800-\udbff]?$/u, isMatch = RegExp.prototype.test;
    function mustHaveFewMarks(text) {
        for (let at = 0; at + manyMarks <= text.length; at += manyMarks)
            if (isMatch.call(allMarks, text.slice(at, at + manyMarks))) refuse(`${manyMarks} combining characters in a row are too many to normalize`);
    }
    const nothing = () => 0;
    for (const name of ["indexOf", "lastIndexOf"]) guardText(name, nothing, toText(), mustBeQuick);
    guardText("includes", nothing, toText(Symbol.match), mustBeQuick);
    guardText("replace", nothing, toText(Symbol.replace), mustBeQuick);
    guardText("repeat", (text, count) => 2 * text.length * count, toNumber);
    for (const name of ["padStart", "padEnd"]) guardText(name, (_, to) => 2 * to, toNumber);
    guardText("split", (text, by) => by === undefined ? 0 : 8 * text.length / Math.max(1, textOf(by).length), toText(Symbol.split), mustBeQuick);
    guardText("replaceAll", (text, from, to) => 2 * text.length * textOf(to).length / Math.max(1, textOf(from).length), toText(Symbol.replace), mustBeQuick);
    guardText("normalize", text => 6 * text.length, value => value, mustHaveFewMarks);
    for (const name of ["toLowerCase", "toUpperCase", "toLocaleLowerCase", "toLocaleUpperCase"])
        guardText(name, text => 6 * text.length);
    for (const [name, longest] of [["encodeURI", 9], ["encodeURIComponent", 9], ["escape", 6]]) {
        const real = globalThis[name];
        guarded.global[name] = {[name](given) {
            const text = String(given);
            hasRoom(3 * longest * text.length);
            return real(text);
        }}[name];
    }
    for (const name of ["join", "toLocaleString"]) {
        const real = Array.prototype[name];
        guarded.Array[name] = {[name](...given) {
            if (Array.isArray(this)) {
                let characters = this.length * (name === "join" && given[0] !== undefined ? textOf(given[0]).length : 1);
                for (let i = 0; i < this.length; ++i) {
                    const one = this[i];
                    if (typeof one === "string") characters += one.length;
                }
                hasRoom(3 * characters);
            }
            return real.apply(this, given);
        }}[name];
    }
    function texts(global) {
        for (const [holder, functions] of [[global.String.prototype, guarded.String], [global.Array.prototype, guarded.Array],
                                           [global, guarded.global]])
            for (const name of Object.keys(functions)) publish(holder, name, functions[name]);
    }
    function json(global) {
        const parse = global.JSON.parse;
        publish(global.JSON, "parse", function (given, ...more) {
            const text = String(given);
            hasRoom(8 * text.length);
            return parse(text, ...more);
        });
    }
    function begin(global) {
        texts(global);
        kinship(global, "Object");
    }

    // ---- `instanceof`: objects and errors that come out of the prelude are of its realm ------------------------------
    const isMade = Function.prototype[Symbol.hasInstance];
    const kin = {Object, Error, TypeError, RangeError, ReferenceError, SyntaxError, InternalError};
    function kinship(global, name) {
        const own = global[name];
        publish(own, Symbol.hasInstance, function (value) {
            if (isMade.call(this, value)) return true;
            const other = this === own || this === global[this?.name] ? kin[this?.name] : undefined;
            return other !== undefined && isMade.call(other, value);
        });
    }
    const errors = global => kinship(global, "Error");

    // By the name that a program uses first.
    const byName = Object.create(null);
    byName.Math = mathematics;
    byName.Date = dates;
    byName.Intl = formats;
    byName.JSON = json;
    for (const name of ["ArrayBuffer", ...typed]) byName[name] = buffers;
    for (const name of Object.keys(kin)) if (name !== "Object") byName[name] = errors;
    texts(globalThis);
    const standing = new WeakMap();  // the fences that a global object has
    function stand(fence, global, self) {
        let up = standing.get(global);
        if (!up) standing.set(global, up = new Set());
        if (up.has(fence)) return;
        up.add(fence);
        fence(global, self);
    }
    return {byName, put: (name, global, self) => stand(byName[name], global, self), begin};
})
