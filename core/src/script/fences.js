// What a Script must not take from the machine: chance, the clock, the time zone, the locale, and more memory at once
// than there is for scripts. Two runs of one document agree wherever they run. Source: ECMA-262, 21.4 (Date); ECMA-402.
//
// Called once for every Script, after the prelude and before the program. Local time is UTC; the locale is en-US.
(function (native, self, global) {
    "use strict";

    function publish(holder, name, value) {
        Object.defineProperty(holder, name, {value, writable: true, configurable: true, enumerable: false});
    }
    const now = () => Math.trunc(native.now() * 1000);

    // ---- chance --------------------------------------------------------------------------------------------------
    let seed = (self * 2654435761 ^ 0x9E3779B9) >>> 0 || 1;
    publish(Math, "random", () => {
        seed ^= seed << 13; seed >>>= 0;
        seed ^= seed >>> 17;
        seed ^= seed << 5; seed >>>= 0;
        return seed / 4294967296;
    });

    // ---- dates: the engine's own, without its clock and its local time ----------------------------------------------
    const RealDate = Date, prototype = RealDate.prototype, parseReal = RealDate.parse;
    const hasZone = /(?:Z|[+-]\d\d:?\d\d|\b(?:GMT|UTC?|[ECMP][SD]T))\s*(?:\(.*\))?\s*$/i;
    const isoDate = /^[+-]?\d{4,6}(?:-\d\d){0,2}$/, isoDateTime = /^[+-]?\d{4,6}(?:-\d\d){0,2}T/;
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
    publish(Date_, "now", now);
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
    const dateText = words => `${words[0].slice(0, 3)} ${words[2]} ${words[1]} ${words[3]}`;
    const timeText = words => `${words[4]} GMT+0000 (UTC)`;
    publish(prototype, "toDateString", function toDateString() { return valid(this, dateText); });
    publish(prototype, "toTimeString", function toTimeString() { return valid(this, timeText); });
    publish(prototype, "toString", function toString() { return valid(this, words => `${dateText(words)} ${timeText(words)}`); });
    const inUtc = options => options?.timeZone === undefined ? Object.assign({}, options, {timeZone: "UTC"}) : options;
    for (const name of ["toLocaleString", "toLocaleDateString", "toLocaleTimeString"]) {
        const real = prototype[name];
        publish(prototype, name, {[name](locales, options) { return real.call(this, locales, inUtc(options)); }}[name]);
    }
    publish(global, "Date", Date_);

    if (typeof Intl === "object") {
        const Real = Intl.DateTimeFormat, formats = Real.prototype;
        function DateTimeFormat(locales, options) { return Reflect.construct(Real, [locales, inUtc(options)], new.target ?? Real); }
        Object.defineProperty(DateTimeFormat, "prototype", {value: formats, writable: false});
        publish(DateTimeFormat, "supportedLocalesOf", Real.supportedLocalesOf);
        publish(formats, "constructor", DateTimeFormat);
        const format = Object.getOwnPropertyDescriptor(formats, "format").get, toParts = formats.formatToParts;
        Object.defineProperty(formats, "format", {
            get() { const f = format.call(this); return (date = now()) => f(date); }, configurable: true,
        });
        publish(formats, "formatToParts", function formatToParts(date = now()) { return toParts.call(this, date); });
        publish(Intl, "DateTimeFormat", DateTimeFormat);
    }

    // ---- memory that is taken in one step, before the watch can look ------------------------------------------------
    function reserve(bytes) {
        if (!native.hasRoomFor(bytes)) throw new RangeError(`out of memory: ${bytes} bytes are more than scripts may hold`);
    }
    function guard(name, bytesOf) {
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
    guard("ArrayBuffer", size);
    for (const name of ["Int8Array", "Uint8Array", "Uint8ClampedArray", "Int16Array", "Uint16Array", "Int32Array", "Uint32Array",
                        "Float32Array", "Float64Array", "BigInt64Array", "BigUint64Array"])
        guard(name, (value, Real) => size(value) * Real.BYTES_PER_ELEMENT);
    // Strings that one call of the engine makes longer, or into more, than what it is given: `bytesOf(text, ...arguments)`
    // is what it may take while it works. Text and numbers are made once, as the engine would.
    const small = 1 << 20, hasRoom = bytes => !(bytes > small) || reserve(bytes);
    const textOf = value => typeof value === "string" ? value : typeof value === "number" ? String(value) : "";
    function guardText(name, bytesOf, prepare = value => value) {
        const real = String.prototype[name];
        publish(String.prototype, name, {[name](...given) {
            if (this === undefined || this === null) return real.apply(this, given);
            const text = String(this);
            if (given.length > 0) given[0] = prepare(given[0]);
            hasRoom(bytesOf(text, ...given));
            return real.apply(text, given);
        }}[name]);
    }
    const toNumber = value => +value;
    guardText("repeat", (text, count) => 2 * text.length * count, toNumber);
    for (const name of ["padStart", "padEnd"]) guardText(name, (_, to) => 2 * to, toNumber);
    guardText("split", (text, by) => by === undefined ? 0 : 8 * text.length / Math.max(1, textOf(by).length));
    guardText("replaceAll", (text, from, to) => 2 * text.length * textOf(to).length / Math.max(1, textOf(from).length));
    for (const name of ["normalize", "toLowerCase", "toUpperCase", "toLocaleLowerCase", "toLocaleUpperCase"])
        guardText(name, text => 6 * text.length);
    for (const [name, longest] of [["encodeURI", 9], ["encodeURIComponent", 9], ["escape", 6]]) {
        const real = global[name];
        publish(global, name, {[name](given) {
            const text = String(given);
            hasRoom(3 * longest * text.length);
            return real(text);
        }}[name]);
    }
    const parseJson = JSON.parse;
    publish(JSON, "parse", function parse(given, ...more) {
        const text = String(given);
        hasRoom(8 * text.length);
        return parseJson(text, ...more);
    });
    for (const name of ["join", "toLocaleString"]) {
        const real = Array.prototype[name];
        publish(Array.prototype, name, {[name](...given) {
            if (Array.isArray(this)) {
                let characters = this.length * (name === "join" && given[0] !== undefined ? textOf(given[0]).length : 1);
                for (let i = 0; i < this.length; ++i) {
                    const one = this[i];
                    if (typeof one === "string") characters += one.length;
                }
                hasRoom(3 * characters);
            }
            return real.apply(this, given);
        }}[name]);
    }
    delete global.WebAssembly;  // its memory is not counted
})
