// Browser, scenes, routes and declarations as a Script sees them, and the numbers in X3DConstants. ISO/IEC 19777-1 V3.3
// clause 7; what a scene is, 19775-2 V3.3.
//
// Evaluated once a thread, before the prelude, which makes each program's own Browser out of it.
(function (native) {
    "use strict";

    const MFString = 11, MFNode = 13;
    const fieldTypes = ["Bool", "Int32", "Float", "Double", "Time", "String", "Node", "Color", "ColorRGBA", "Image", "Vec2f", "Vec2d",
                        "Vec3f", "Vec3d", "Vec4f", "Vec4d", "Rotation", "Matrix3f", "Matrix3d", "Matrix4f", "Matrix4d"];
    const constants = {
        INITIALIZED_EVENT: 0, SHUTDOWN_EVENT: 1, CONNECTION_ERROR: 2, INITIALIZED_ERROR: 3,
        NOT_STARTED_STATE: 0, IN_PROGRESS_STATE: 1, COMPLETE_STATE: 2, FAILED_STATE: 3,
        initializeOnly: 0, inputOnly: 1, outputOnly: 2, inputOutput: 3,
    };
    fieldTypes.forEach((name, i) => { constants["SF" + name] = 2 * i; constants["MF" + name] = 2 * i + 1; });
    native.typeNames().forEach((name, i) => { constants[name] = i + 1; });

    // ---- what objects are called -----------------------------------------------------------------------------
    // A program can ask `instanceof` one of these, and make none. Lists are arrays of the program's own.
    const kinds = Object.create(null), kindsOfLists = new WeakMap();
    function defineKind(name, base = Object) {
        const made = {[name]: function () { throw new (native.global().TypeError)(`${name} cannot be made by a program`); }}[name];
        made.prototype = Object.create(base.prototype);
        Object.defineProperty(made.prototype, "constructor", {value: made});
        Object.defineProperty(made.prototype, Symbol.toStringTag, {value: name});
        return kinds[name] = made;
    }
    defineKind("X3DScene", defineKind("X3DExecutionContext"));
    for (const name of ["X3DBrowser", "X3DRoute", "X3DProtoDeclaration", "X3DFieldDefinition", "ProfileInfo", "ComponentInfo", "UnitInfo"]) defineKind(name);
    defineKind("X3DExternProtoDeclaration", kinds.X3DProtoDeclaration);
    for (const name of ["RouteArray", "ProtoDeclarationArray", "ExternProtoDeclarationArray", "FieldDefinitionArray", "ProfileInfoArray",
                        "ComponentInfoArray", "UnitInfoArray"])
        Object.defineProperty(defineKind(name), Symbol.hasInstance, {value: list => kindsOfLists.get(list) === name});
    const made = (kind, ...parts) => parts.reduce((whole, part) => Object.defineProperties(whole, Object.getOwnPropertyDescriptors(part)),
                                                  Object.create(kinds[kind].prototype));
    function listOf(kind, list) {
        kindsOfLists.set(list, kind);
        return list;
    }

    /// A list of [key, value, ...] by rows of `width`.
    const rows = (flat, width) => Array.from({length: Math.floor(flat.length / width)}, (_, i) => flat.slice(i * width, (i + 1) * width));
    const properties = {
        ABSTRACT_NODES: true, CONCRETE_NODES: true, EXTERNAL_INTERACTIONS: true, PROTOTYPE_CREATE: true, DOM_IMPORT: false,
        XML_ENCODING: true, CLASSIC_VRML_ENCODING: true, BINARY_ENCODING: false,
    };

    /// `program`: what the prelude gives of one: its Script (`self`), its objects for nodes, and how edits are made.
    function makeBrowser({self, nodeOf, idOf, flush, fail, flatten, offered, ownArray, print, println}) {
        const nodes = ids => offered(MFNode, ids, nodeOf);
        const urls = given => flatten(MFString, given);
        const must = answer => { if (typeof answer === "string") fail("Error", answer); return answer; };
        /// What was assigned before takes effect first; and what is refused is an error.
        const edit = f => (...given) => { flush(); must(f(...given)); };
        const flushed = f => (...given) => { flush(); return f(...given); };

        // ---- fields, declarations ------------------------------------------------------------------------------
        const definitions = answer => {
            const [names, types, accesses] = must(answer);
            return listOf("FieldDefinitionArray", ownArray(names.map((name, i) => made("X3DFieldDefinition", {name, dataType: types[i], accessType: accesses[i]}))));
        };
        const component = (name, level) => made("ComponentInfo", {name, level, title: name, providerURL: ""});
        const componentList = (names, levels) => listOf("ComponentInfoArray", ownArray(names.map((name, i) => component(name, levels[i]))));
        const components = () => componentList(...native.components());
        function profiles() {
            const [names, counts, parts, levels] = native.profiles();
            let at = 0;
            return listOf("ProfileInfoArray", ownArray(names.map((name, i) => {
                const from = at, to = at += counts[i];
                return made("ProfileInfo", {name, title: name, providerURL: "", components: componentList(parts.slice(from, to), levels.slice(from, to))});
            })));
        }
        const profile = name => profiles().find(one => one.name === String(name));
        const createNode = type => {
            const id = native.createNode(self, String(type));
            if (typeof id === "string") fail("TypeError", id);
            return nodeOf(id);
        };
        // In an EXTERNPROTO's text only its urls are in quotes.
        const quoted = text => Array.from(text.matchAll(/"((?:[^"\\]|\\.)*)"/gs), ([, inside]) => inside.replace(/\\(.)/gs, "$1"));
        /// Whether it has been loaded is seen at its instances.
        const loadState = name => ({undefined: constants.NOT_STARTED_STATE, true: constants.COMPLETE_STATE, false: constants.FAILED_STATE})[native.hasBody(name)];
        const declaration = (name, external) => made(external ? "X3DExternProtoDeclaration" : "X3DProtoDeclaration", {
            name, isExternProto: external, get fields() { return definitions(native.fieldsOfType(name)); },
            newInstance: () => createNode(name),
        }, external ? {
            get urls() { return offered(MFString, quoted(native.declaration(name))); },
            get loadState() { return loadState(name); },
            loadNow() { if (loadState(name) !== constants.COMPLETE_STATE) createNode(name); },
        } : {});
        const declarations = external => listOf(external ? "ExternProtoDeclarationArray" : "ProtoDeclarationArray",
                                                ownArray(native.prototypes(external).map(name => declaration(name, external))));
        const declared = (name, external) => native.prototypes(external).includes(String(name))
            ? declaration(String(name), external) : fail("ReferenceError", `no prototype is named ${name}`);
        /// Nodes are made of declarations, so one that is there can be neither replaced nor removed.
        function updateDeclaration(kind, name, given) {
            if (!(given instanceof kinds[kind])) fail("TypeError", `${kind} was expected`);
            if (String(name) !== given.name) edit(native.declareAs)(String(name), given.name);
        }
        function removeDeclaration(name, external) {
            declared(name, external);
            fail("Error", `${name} stays: a prototype is declared as long as its world is there`);
        }
        const createProto = name => {
            if (!native.prototypes(false).includes(String(name)) && !native.prototypes(true).includes(String(name)))
                fail("ReferenceError", `no prototype is named ${name}`);
            return createNode(name);
        };

        // ---- routes --------------------------------------------------------------------------------------------
        const route = (sourceNode, sourceField, destinationNode, destinationField) =>
            made("X3DRoute", {sourceNode, sourceField, destinationNode, destinationField});
        const change = f => (from, fromField, to, toField) =>
            edit(f)(self, idOf(from), String(fromField), idOf(to), String(toField));
        const addRoute = (from, fromField, to, toField) => {
            change(native.addRoute)(from, fromField, to, toField);
            return route(from, String(fromField), to, String(toField));
        };
        // A route, or its four ends.
        const deleteRoute = (from, ...ends) => ends.length > 0 ? change(native.deleteRoute)(from, ...ends)
            : change(native.deleteRoute)(from.sourceNode, from.sourceField, from.destinationNode, from.destinationField);
        const routes = () => {
            const [from, fromFields, to, toFields] = native.routes(self);
            return listOf("RouteArray", ownArray(fromFields.map((field, i) => route(nodeOf(from[i]), field, nodeOf(to[i]), toFields[i]))));
        };

        // ---- scenes --------------------------------------------------------------------------------------------
        const common = {
            specificationVersion: "4.0", encoding: "ASCII",
            createNode, createProto, addRoute, deleteRoute,
            get routes() { return routes(); },
            get protos() { return declarations(false); },
            get externprotos() { return declarations(true); },
            getProtoDeclaration: name => declared(name, false),
            updateProtoDeclaration: (name, given) => updateDeclaration("X3DProtoDeclaration", name, given),
            removeProtoDeclaration: name => removeDeclaration(name, false),
            getExternProtoDeclaration: name => declared(name, true),
            updateExternProtoDeclaration: (name, given) => updateDeclaration("X3DExternProtoDeclaration", name, given),
            removeExternProtoDeclaration: name => removeDeclaration(name, true),
            get worldURL() { return native.folder(); },
        };
        const [kProfile, kComponents, kMeta, kUnits, kImports, kExports] = [0, 1, 2, 3, 4, 5];
        const info = (part, width) => rows(native.documentInfo()[part], width);
        const setInfo = (name, list) => edit(native.setDocumentInfo)(name, list.flat());
        function getNamedNode(name) {
            const id = native.named(self, String(name));
            if (!id) fail("ReferenceError", `no node is named ${name}`);
            return nodeOf(id);
        }
        const exported = name => info(kExports, 2).find(one => one[1] === String(name));
        const addRootNode = node => edit(native.addRoot)(idOf(node)), removeRootNode = node => edit(native.removeRoot)(idOf(node));
        const isInPrototype = native.isInPrototype(self);
        /// Of every execution context.
        const ofContext = {
            isScene: !isInPrototype,
            get profile() {
                const name = native.documentInfo()[kProfile][0];
                return profile(name) ?? made("ProfileInfo", {name, title: name, providerURL: "", components: components()});
            },
            get components() {
                const known = info(kComponents, 2);
                return componentList(known.map(one => one[0]), known.map(one => Number(one[1])));
            },
            get units() {
                return listOf("UnitInfoArray", ownArray(info(kUnits, 3).map(([category, name, factor]) =>
                    made("UnitInfo", {category, name, conversionFactor: Number(factor)}))));
            },
            get rootNodes() { return nodes(native.roots(self)); },
            set rootNodes(list) {
                if (isInPrototype) fail("TypeError", "rootNodes of a prototype's instance cannot be written");
                const wanted = Array.from(list), ids = wanted.map(idOf), there = Array.from(this.rootNodes);
                for (const node of there) if (!ids.includes(idOf(node))) removeRootNode(node);
                for (const node of wanted) if (!there.includes(node)) addRootNode(node);
            },
            getNamedNode,
            updateNamedNode: (name, node) => edit(native.rename)(idOf(node), String(name)),
            removeNamedNode: name => edit(native.rename)(idOf(getNamedNode(name)), ""),
            getImportedNode(name) {
                const id = native.localNode(self, String(name));
                if (!id) fail("ReferenceError", `nothing was imported as ${name}`);
                return nodeOf(id);
            },
            updateImportedNode(inline, name, local = name) {
                const holder = native.nodeName(idOf(inline));
                if (!holder) fail("Error", "an Inline without a name exports nothing");
                const others = info(kImports, 3).filter(one => one[2] !== String(local));
                setInfo("imports", [...others, [holder, String(name), String(local)]]);
            },
            removeImportedNode: name => setInfo("imports", info(kImports, 3).filter(one => one[2] !== String(name))),
        };
        /// Of scenes alone.
        const ofScene = {
            addRootNode, removeRootNode,
            getExportedNode(name) {
                const id = native.localNode(self, exported(name)?.[0] ?? "");
                if (!id) fail("ReferenceError", `nothing is exported as ${name}`);
                return nodeOf(id);
            },
            updateExportedNode(name, node) {
                // As it is named here: what is imported may be passed on.
                const id = idOf(node), names = [native.nodeName(id), ...info(kImports, 3).map(one => one[2])];
                const local = names.find(one => one && native.localNode(self, one) === id);
                if (!local) fail("Error", "a node that has no name in the document cannot be exported");
                setInfo("exports", [...info(kExports, 2).filter(one => one[1] !== String(name)), [local, String(name)]]);
            },
            removeExportedNode: name => setInfo("exports", info(kExports, 2).filter(one => one[1] !== String(name))),
            getMetaData: name => info(kMeta, 2).find(one => one[0] === String(name))?.[1],
            setMetaData(name, content) {
                setInfo("meta", [...info(kMeta, 2).filter(one => one[0] !== String(name)), [String(name), String(content)]]);
            },
        };
        // The world's own document alone: what an Inline or a PROTO is in is not its to read.
        const ofWorld = native.isInWorld(self) ? {
            toVRMLString: flushed(() => native.nodeText(0, 0)), toXMLString: flushed(() => native.nodeText(0, 1)),
            toJSONString: flushed(() => native.nodeText(0, 2)),
        } : {};
        const currentScene = isInPrototype ? made("X3DExecutionContext", common, ofContext) : made("X3DScene", common, ofContext, ofScene, ofWorld);

        // Nodes that hang nowhere yet. What is added is kept in the piece until it is put somewhere.
        const pieces = new WeakMap();
        function piece(answer) {
            if (typeof answer === "string") fail("Error", answer);
            const roots = Array.from(answer[0], nodeOf), named = new Map(answer[1].map((name, i) => [name, nodeOf(answer[2][i])]));
            const whole = made("X3DScene", common, {
                isScene: true, profile: profile("Full"), units: listOf("UnitInfoArray", ownArray([])), components: componentList([], []),
                get rootNodes() { return nodes(roots.map(idOf)); },
                addRootNode(node) { idOf(node); roots.push(node); },
                removeRootNode(node) { const at = roots.indexOf(node); if (at >= 0) roots.splice(at, 1); },
                getNamedNode: name => named.get(String(name)) ?? fail("ReferenceError", `no node is named ${name}`),
                updateNamedNode(name, node) { idOf(node); named.set(String(name), node); },
                set rootNodes(list) { roots.splice(0, roots.length, ...Array.from(list, node => { idOf(node); return node; })); },
                removeNamedNode(name) { named.delete(String(name)); },
                dispose() { roots.length = 0; named.clear(); },
            });
            pieces.set(whole, {roots, named});
            return whole;
        }
        const ofText = text => piece(native.pieceOfText(self, String(text)));
        /// With a node and the name of one of its fields the nodes come as an event, in a later frame; else at once.
        const ofUrls = (given, node, field) => {
            if (node === undefined || node === null) return piece(native.pieceOfUrls(self, urls(given)));
            must(native.askPiece(self, urls(given), idOf(node), String(field)));
        };

        // ---- Browser -------------------------------------------------------------------------------------------
        // A program begins when its browser has been initialized for long, and hears of the end alone.
        const listeners = new Set();
        function tellListeners() {
            for (const listener of listeners)
                if (typeof listener === "function") listener(constants.SHUTDOWN_EVENT); else listener.browserChanged(constants.SHUTDOWN_EVENT);
        }
        const browser = made("X3DBrowser", {
            name: "RTSG", version: native.version, description: "",
            get currentSpeed() { return native.speed(); },
            currentFrameRate: 0,  // a scene knows no pace: whoever runs it does
            currentScene, print, println, addRoute, deleteRoute,
            get supportedComponents() { return components(); },
            get supportedProfiles() { return profiles(); },
            getProfile: name => profile(name) ?? fail("ReferenceError", `no profile is named ${name}`),
            getComponent(name, level = 1) {
                const known = components().find(one => one.name === String(name) && one.level >= level);
                return known ? component(known.name, level) : fail("ReferenceError", `no component ${name} of level ${level}`);
            },
            getName() { return this.name; },
            getVersion() { return this.version; },
            getCurrentSpeed: () => native.speed(),
            getCurrentFrameRate() { return this.currentFrameRate; },
            getCurrentTime: () => native.now(),
            getWorldURL: () => native.folder(),
            setDescription(text) { this.description = String(text); },
            getBrowserOption: () => undefined,
            setBrowserOption: () => false,
            getBrowserProperty: name => Object.hasOwn(properties, name) ? properties[name] : false,
            getRenderingProperty: () => undefined,
            getExecutionContext: () => currentScene,
            createScene: () => piece([[], [], []]),
            createVrmlFromString: text => ofText(text).rootNodes,
            createX3DFromString: ofText, createX3DFromStream: ofText,
            createVrmlFromURL(given, node, field) {
                const made = ofUrls(given, node, field);
                return made ? made.rootNodes : undefined;
            },
            createX3DFromURL: ofUrls,
            importDocument: () => fail("Error", "there is no document object model here"),
            loadURL: flushed(given => { must(native.askWorld(self, urls(given))); }),
            replaceWorld: flushed(given => {
                if (given === currentScene) return;  // it is the world already
                const isNone = given === null || given === undefined, known = isNone ? undefined : pieces.get(given);
                if (!isNone && !known && typeof given[Symbol.iterator] !== "function") fail("TypeError", "replaceWorld takes a scene or nodes");
                const {roots, named} = known ?? {roots: isNone ? [] : Array.from(given), named: new Map()};
                must(native.replaceWorld(self, flatten(MFNode, roots), Array.from(named.keys()), flatten(MFNode, Array.from(named.values()))));
            }),
            firstViewpoint: flushed(() => { must(native.viewpoint(0)); }), previousViewpoint: flushed(() => { must(native.viewpoint(1)); }),
            nextViewpoint: flushed(() => { must(native.viewpoint(2)); }), lastViewpoint: flushed(() => { must(native.viewpoint(3)); }),
            /// By its name or description; a layer before it says nothing more, as only the active one has any.
            changeViewpoint: flushed((...given) => { must(native.viewpointCalled(self, String(given.at(-1)))); }),
            // What a call edits is one set whatever it says.
            beginUpdate() {}, endUpdate() {},
            addBrowserListener(listener) {
                if (typeof listener !== "function" && typeof listener?.browserChanged !== "function") fail("TypeError", "a listener is a function");
                listeners.add(listener);
            },
            removeBrowserListener(listener) { listeners.delete(listener); },
        });
        return {browser, tellListeners};
    }

    /// Of nodes, by number.
    const nodeMethods = {
        getNodeType: (id, {ownArray}) => ownArray(native.kindsOf(id).map(name => constants[name] ?? 0)),
        getFieldDefinitions(id, {ownArray}) {
            const [names, types, accesses] = native.fieldsOf(id);
            return listOf("FieldDefinitionArray", ownArray(names.map((name, i) => made("X3DFieldDefinition", {name, dataType: types[i], accessType: accesses[i]}))));
        },
        toVRMLString: id => native.nodeText(id, 0), toX3DString: id => native.nodeText(id, 0),
        toXMLString: id => native.nodeText(id, 1),
        toJSONString: id => native.nodeText(id, 2),
    };
    return {constants, kinds, makeBrowser, nodeMethods};
})
