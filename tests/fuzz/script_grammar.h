// Turns bytes into ECMAScript over the whole binding that a Script has: a byte picks a production, so that small
// changes of the bytes are small changes of the program. Bytes that have run out pick the first production, which is a
// leaf.
//
// `%` and a letter stand for one of the productions of that letter: E any value, S a statement, N a node, O an object
// of the binding, F a function, I a number, T a text, X a piece of X3D as a text, U urls, A a field, M what values
// have, G what arrays have, C a constructor, V a variable, J a promise.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace rtsg::fuzz {

inline constexpr std::string_view kScriptGrammar = R"script(
V: a | b | c | kept
I: 1 | 0 | -1 | 3 | 7 | 0.5 | 100 | 1e3 | 65536 | -0 | NaN | Infinity | 1e-320 | 2147483648 | 4294967295 | 1e300 | now
T: '' | 'x' | 'value' | String(%E) | 'x'.repeat(%I) | '\u0000\ud800' | typeof %E | a + 'x' | (%T + %T)
  | '\u0101\u0301\u0323' | %N.getNodeTypeName() | %N.getNodeName() | JSON.stringify(%E) | %T.%t
  | Browser.getWorldURL()
t: trim() | toUpperCase() | normalize('NFD') | split(%T) | indexOf(%T) | replace(%T, %T) | replace(/(.)\1*/g, %F)
  | padEnd(%I, %T) | replaceAll(%T, %T) | match(/(x+x+)+y/) | localeCompare(%T) | slice(%I, %I) | codePointAt(%I)
  | at(%I)
A: translation | children | v | n | f | s | node | nodes | vs | m | image | rotation | scale | url | set_fraction | go
  | fraction_changed | enabled | loop | cycleInterval | keyValue | geometry | metadata | directOutput | mustEvaluate
  | size | stopTime | whichChoice | choice | proxy | colors | strings | bools | images | nothing | __proto__
N: node | O | scene.getNamedNode('%n') | scene.createNode('%k') | Browser.createVrmlFromString(%X)[0]
  | scene.rootNodes[%I] | nodes[%I] | Browser.createX3DFromString(%X).rootNodes[0] | scene.createProto('P')
  | %N.children[0] | %V | null | scene.routes[%I].sourceNode | scene.getExportedNode(%T)
n: S | O | T | G | C | I | M | W | none
k: Transform | Group | Script | TimeSensor | Switch | P | PositionInterpolator | Inline | Viewpoint | Shape
  | BooleanToggle | Anchor | LOD | NoSuchType | Text | PixelTexture | IndexedFaceSet | PositionChaser | StringSensor
  | KeySensor | EaseInEaseOut
X: '' | 'Group { }' | 'DEF T Transform { translation 1 2 3 children Group { } }' | 'Shape { geometry Box { } }'
  | 'P { size 2 }'
  | 'Script { directOutput TRUE url "ecmascript: function initialize() { n = 1; Browser.loadURL([]); }" }'
  | 'PROTO Q [ ] { Group { } } Q { } Q { }'
  | 'DEF A Transform { } DEF B Transform { } ROUTE A.translation TO B.translation' | 'Inline { url "nothing.x3dv" }'
  | %T | '#X3D V4.0 utf8\nGroup { ' + %X + ' }' | %N.toVRMLString() | %N.toXMLString()
  | ('Group { children ' + %X + ' }').repeat(3) | 'DEF G Group { children USE G }'
  | 'Script { url "javascript: function prepareEvents() { throw 1; }" } TimeSensor { loop TRUE }'
U: ['nothing.x3dv'] | [] | 'data:model/x3d+vrml,Group%20{}'
  | new MFString('data:model/x3d+vrml,%23X3D%20V4.0%20utf8%0AGroup{}') | ['file:///etc/hostname'] | [%T, %T]
  | ['ecmascript: function initialize() { n = 2; }'] | ['javascript:for(;;);'] | %E
C: SFVec3f | SFVec2f | SFVec4d | SFColor | SFColorRGBA | SFRotation | SFImage | SFMatrix3f | SFMatrix4d | SFNode
  | MFVec3f | MFInt32 | MFString | MFNode | MFRotation | MFImage | MFColor | MFBool | MFTime | MFMatrix4f | SFVec3d
  | SFMatrix4f | Array | Object | Map | Set | Uint8Array | Float64Array | ArrayBuffer | Proxy | RegExp | Date | Error
  | Function | String | Number | Symbol | BigInt | Promise | WeakMap | FinalizationRegistry | WeakRef | AggregateError
  | DataView
M: add(%E) | length() | multVec(%E) | normalize() | cross(%E) | toString() | components() | equals(%E) | copy()
  | lerp(%E, %I) | negate() | inverse() | multiply(%E) | slerp(%E, %I) | setHSV(%I, %I, %I) | getHSV() | transpose()
  | multLeft(%E) | multVecMatrix(%E) | determinant() | det3() | setTransform(%E, %E, %E) | getTransform(%E, %E, %E)
  | getAxis() | setAxis(%E) | zip(%E, %F) | map(%F) | quaternion() | constructor(%E) | constructor.keys | x | y = %E
  | angle | width | array | dispose()
G: push(%E) | length | length = %I | [%I] | [%I] = %E | pop() | slice(%I) | splice(%I, %I, %E) | concat(%E) | map(%F)
  | join(%T) | fill(%E) | sort(%F) | reverse() | flat(%I) | includes(%E) | indexOf(%E) | forEach(%F) | reduce(%F, %E)
  | [%I].x = %I | toString() | copyWithin(%I, %I) | entries().next() | constructor | __proto__ = %E
F: () => %E | function(x, y) { return %E; } | x => { %S return x; } | %V | function* () { yield %E; } | async () => %E
  | print | Browser.%w | %C | x => x.%M | function r(x) { return [r(x)]; } | (x, y) => x < y
  | class { constructor() { %S } } | function() { return this; } | Object | Reflect.ownKeys
w: print | addRoute | createVrmlFromString | loadURL | replaceWorld | getName | currentScene.createNode
  | nextViewpoint
J: Promise.resolve(%E) | Promise.reject(%E) | %J.then(%F) | %J.then(%F, %F) | %J.catch(%F) | %J.finally(%F)
  | new Promise(%F) | Promise.all([%J, %J]) | Promise.race(%E) | (async () => { await %E; %S })() | import(%T)
  | (async function step() { await null; step(); })() | Promise.any([%J])
O: Browser | Browser.currentScene | X3DConstants | scene.routes | scene.protos | scene.getProtoDeclaration('P')
  | globalThis | console | Browser.createScene() | Browser.createX3DFromString(%X) | Browser.supportedComponents
  | Browser.getExecutionContext().%e | Browser.createX3DFromURL(%U) | scene.getProtoDeclaration('P').newInstance()
  | %N.getFieldDefinitions() | %N.getNodeType() | Math
e: units | components | profile | externprotos | worldURL | encoding | getMetaData(%T) | specificationVersion
  | rootNodes
E: 1 | %V | %I | %T | value | %N | new %C(%E, %E, %E) | %C(%E) | new %C() | %V.%M | %V.%A | %N.%A | %O | %F | %J
  | [%E, %E] | [...%E] | {x: %E, get y() { return %E; }, valueOf: %F, toString: %F} | %V.%G | (%F)(%E, %E) | (%E + %E)
  | (%E, %E) | new Proxy(%E, {get: %F, has: %F}) | Object.freeze(%E) | Reflect.construct(%C, [%E]) | eval(%T)
  | Function(%T) | new %C(%I) | %E[%T] | %E instanceof %C | delete %V.%A | Object.getPrototypeOf(%E)
  | Object.assign(%E, %E) | /(a|aa)+$/.exec(%T) | %N[%T] | `${%E}` | new Date(%E).toString() | Math.random()
  | BigInt(%I) ** 9999n | JSON.parse(%T) | Array.from(%E, %F) | Array.from({length: %I}, %F) | new (%F)(%E)
  | Symbol.iterator in %E | Object.defineProperty(%E, %T, {get: %F, configurable: true})
  | Intl.NumberFormat().format(%I) | structuredClone | (%E)?.constructor | Object.setPrototypeOf(%E, %E) | %A
  | %E.flatMap(%F) | new Error(%T, {cause: %E}) | Object.defineProperty(new Error, 'stack', {get: %F})
S: {} | %V = %E; | %A = %E; | %N.%A = %E; | print(%E); | kept.push(%E); | %E; | if (%E) { %S } else { %S } | %S %S
  | for (var i = 0; i < 3; ++i) { %S } | for (var x of %E) { %S } | for (var k in %E) { %S } | for (;;) { %S }
  | while (%E) { %S } | try { %S } catch (e) { %S } | try { %S } finally { %S } | throw %E; | throw new %C(%T);
  | %V.%M; | %V.%G; | %A.%G; | %A.%M; | Browser.addRoute(%N, '%A', %N, '%A');
  | Browser.deleteRoute(%N, '%A', %N, '%A'); | scene.addRoute(O, 'v', O, '%A'); | scene.deleteRoute(scene.routes[%I]);
  | scene.addRootNode(%N); | scene.removeRootNode(%N); | scene.updateNamedNode(%T, %N); | scene.removeNamedNode('%n');
  | Browser.loadURL(%U); | Browser.replaceWorld(%E); | Browser.createVrmlFromURL(%U, %N, '%A'); | %N.dispose();
  | O.url = %U; | O.url = O.url; | url = %U; | scene.setMetaData(%T, %T); | scene.updateExportedNode(%T, %N);
  | scene.updateImportedNode(%N, %T); | Browser.%b;
  | var p = Browser.createX3DFromString(%X); p.addRootNode(%N); p.%e; Browser.replaceWorld(p); | %J; | (%F)(%E);
  | for (var x of (%F)()) { %S } | globalThis.%A = %E; | %O.%A = %E; | Array.prototype.%p = %F;
  | Object.prototype.%p = %E; | %C = %F; | %C.prototype.%p = %F; | Object.defineProperty(globalThis, '%A', {get: %F});
  | node = scene.createNode('%k'); | node = Browser.createVrmlFromString(%X)[0]; scene.addRootNode(node);
  | for (var i = 0; i < 300; ++i) scene.createNode('%k'); | nodes = new MFNode(%N, %N, %N); | go(%E, 1);
  | initialize = %F; | scene.rootNodes.forEach(%F); | new FinalizationRegistry(%F).register({}, %E);
  | with (%E) { %S } | switch (%E) { case %E: %S default: %S }
  | var big = []; for (;;) big.push(new Array(1000).fill(%E)); | var text = 'x'; for (;;) text += text;
b: firstViewpoint() | nextViewpoint() | getProfile(%T) | getComponent(%T, %I) | setDescription(%E) | description = %E
  | createVrmlFromString(%E) | getRenderingProperty(%T) | importDocument(%E) | getCurrentSpeed()
  | getBrowserProperty(%T) | currentScene = %E | println(%E) | createX3DFromStream(%E) | createX3DFromString(%E)
p: push | toString | valueOf | then | constructor | length | 0 | get | stack | join)script";

using ScriptRules = std::map<char, std::vector<std::string_view>>;

/// A rule begins at the left margin; ` | ` stands between its productions.
inline ScriptRules readRules(std::string_view grammar) {
    constexpr std::string_view kBetween = " | ";
    ScriptRules rules;
    char rule = 0;
    while (!grammar.empty()) {
        const std::size_t end = grammar.find("\n", 1);
        std::string_view line = grammar.substr(1, end == grammar.npos ? end : end - 1);
        grammar.remove_prefix(end == grammar.npos ? grammar.size() : end);
        if (line.starts_with(' ')) {
            line.remove_prefix(4);
        } else {
            rule = line.front();
            line.remove_prefix(3);
        }
        for (std::size_t at; (at = line.find(kBetween)) != line.npos; line.remove_prefix(at + kBetween.size()))
            rules[rule].push_back(line.substr(0, at));
        rules[rule].push_back(line);
    }
    return rules;
}

class ScriptWriter {
  public:
    explicit ScriptWriter(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

    /// A program with the functions that the scene calls. What fails does not keep the rest from being tried.
    std::string program() {
        std::string text = kOpening;
        for (const char* variable : {"a", "b", "c"})
            text += std::string("var ") + variable + expand(" = attempt(() => %E);\n");
        for (const char* function : {"initialize()", "go(value, time)", "prepareEvents()", "eventsProcessed()",
                                     "set_v(value)", "set_node(value)", "shutdown()"})
            if (next() % 3 != 0)
                text += std::string("function ") + function +
                        expand(" { attempt(() => { %S }); attempt(() => { %S }); %S }\n");
        return text;
    }

    /// What every program begins with. How deep one gets before it fails is up to the machine: that is no value.
    static constexpr const char* kOpening = R"(
var scene = Browser.currentScene, O = scene.getNamedNode('O'), now = Browser.getCurrentTime(), kept = [], value = 1;
function attempt(f) { try { return f(); } catch (e) { if (e instanceof InternalError) throw e; return e; } }
)";

  private:
    std::uint8_t next() {
        if (at_ == bytes_.size()) return 0;
        return bytes_[at_++];
    }

    std::string expand(std::string_view production) {
        static const ScriptRules rules = readRules(kScriptGrammar);
        constexpr int kDeepest = 9;
        constexpr std::size_t kLongest = 4000;
        std::string text;
        ++depth_;
        for (std::size_t i = 0; i < production.size(); ++i) {
            const bool isRule = production[i] == '%' && i + 1 < production.size();
            const auto rule = isRule ? rules.find(production[i + 1]) : rules.end();
            if (rule == rules.end()) {
                text += production[i];
                ++written_;
                continue;
            }
            ++i;
            const bool isLeaf = depth_ > kDeepest || written_ > kLongest;
            text += expand(rule->second[isLeaf ? 0 : next() % rule->second.size()]);
        }
        --depth_;
        return text;
    }

    std::span<const std::uint8_t> bytes_;
    std::size_t at_ = 0, written_ = 0;
    int depth_ = 0;
};

}  // namespace rtsg::fuzz
