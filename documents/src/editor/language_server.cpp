// Speaks the Language Server Protocol: keeps the documents that an editor has open, and answers about them.
#include <rtsg/documents/language_server.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <rtsg/documents/filters.h>
#include <rtsg/documents/read_document.h>
#include <rtsg/documents/resource_check.h>
#include <rtsg/documents/scene_builder.h>

#include "answers.h"
#include "outline.h"
#include "text_lines.h"

namespace rtsg {

namespace {

using editor::TextLines;
using editor::TextPosition;
using editor::TextRange;
using Json = nlohmann::json;

// JSON-RPC 2.0, 5.1, and LSP 3.17.
constexpr int kParseError = -32700, kInvalidRequest = -32600, kMethodNotFound = -32601, kInvalidParams = -32602,
              kNotInitialized = -32002, kRequestFailed = -32803;
constexpr std::size_t kDeepestMessage = 64;  // of a message
constexpr std::size_t kMaxProposals = 2000;

/// The member, or null where there is no such thing.
const Json& member(const Json& of, const char* name) {
    static const Json none;
    if (!of.is_object()) return none;
    const auto found = of.find(name);
    return found == of.end() ? none : *found;
}
std::string textOf(const Json& value) {
    return value.is_string() ? value.get<std::string>() : std::string();
}
std::uint32_t countOf(const Json& value) {
    if (!value.is_number_unsigned()) return 0;
    return static_cast<std::uint32_t>(std::min<std::uint64_t>(value.get<std::uint64_t>(), UINT32_MAX));
}

/// Limits nested brackets: messages are shallow, and deep ones would take long.
bool isTooDeep(std::string_view message) {
    std::size_t depth = 0;
    bool isText = false;
    for (std::size_t i = 0; i < message.size(); ++i) {
        const char c = message[i];
        if (isText) {
            if (c == '\\')
                ++i;
            else if (c == '"')
                isText = false;
        } else if (c == '"') {
            isText = true;
        } else if (c == '[' || c == '{') {
            if (++depth > kDeepestMessage) return true;
        } else if ((c == ']' || c == '}') && depth > 0) {
            --depth;
        }
    }
    return false;
}

int hexOf(char c) {
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
}
/// The file of a `file:` uri; empty for others, such as that of a document that has no file as yet. Source: RFC 8089.
std::filesystem::path fileOf(std::string_view uri) {
    constexpr std::string_view kScheme = "file://";
    if (!uri.starts_with(kScheme)) return {};
    uri.remove_prefix(std::min(uri.find('/', kScheme.size()), uri.size()));
    std::string path;
    for (std::size_t i = 0; i < uri.size(); ++i) {
        const int high = i + 2 < uri.size() && uri[i] == '%' ? hexOf(uri[i + 1]) : -1;
        const int low = high >= 0 ? hexOf(uri[i + 2]) : -1;
        if (low >= 0) {
            path += static_cast<char>(high * 16 + low);
            i += 2;
        } else {
            path += uri[i];
        }
    }
    return path.contains('\0') ? std::filesystem::path() : std::filesystem::path(path);
}

struct Gate {
    Filter gate;
};

/// Drops the rest of a document once a message waits: it may be another edit.
class Abandoned final : private Gate, public Filter {
  public:
    Abandoned(DocumentHandler& next, const std::function<bool()>& isAwaited)
        : Gate{Filter(next)}, Filter(gate), isAwaited_(isAwaited) {}
    bool isOver() const { return isOver_; }

    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) override {
        constexpr std::size_t kPerLook = 64;  // nodes
        if (isAwaited_ && !isOver_ && ++nodes_ % kPerLook == 0 && isAwaited_()) {
            isOver_ = true;
            gate = Filter();
        }
        Filter::beginNode(type, def, field, where);
    }

  private:
    const std::function<bool()>& isAwaited_;
    std::size_t nodes_ = 0;
    bool isOver_ = false;
};

}  // namespace

struct LanguageServer::State {
    struct Document {
        std::string text;
        Json version;
    };

    const LanguageServerOptions options;
    const std::function<void(std::string_view)> send;
    std::map<std::string, Document> documents;  // by uri
    std::set<std::string> edited;               // since their faults were reported
    bool isInitialized = false, countsBytes = false, wasAsked = false, hasEnded = false;

    void write(Json message) const {
        message["jsonrpc"] = "2.0";
        send(message.dump(-1, ' ', false, Json::error_handler_t::replace));
    }
    void answer(const Json& id, Json result) const { write({{"id", id}, {"result", std::move(result)}}); }
    void refuse(const Json& id, int code, std::string why) const {
        write({{"id", id}, {"error", {{"code", code}, {"message", std::move(why)}}}});
    }

    Json positionOf(const TextLines& lines, std::size_t offset) const {
        const TextPosition position = lines.positionOf(offset);
        return {{"line", position.line}, {"character", position.character}};
    }
    Json rangeOf(const TextLines& lines, TextRange range) const {
        return {{"start", positionOf(lines, range.begin)}, {"end", positionOf(lines, range.end)}};
    }
    static TextPosition positionOf(const Json& position) {
        return {countOf(member(position, "line")), countOf(member(position, "character"))};
    }
    static std::string uriOf(const Json& params) { return textOf(member(member(params, "textDocument"), "uri")); }

    void initialize(const Json& id, const Json& params);
    void notify(const std::string& method, const Json& params);
    void open(const Json& params);
    void change(const Json& params);
    void close(const Json& params);
    /// A request about a place of a document.
    struct Question {
        const std::string &uri, &text;
        const Json& params;
        const TextLines& lines;
        std::size_t offset;
    };
    void ask(const Json& id, const std::string& method, const Json& params);
    Json complete(const Question& at) const;
    Json explain(const Question& at) const;
    Json define(const Question& at) const;
    Json mend(const Question& at) const;
    Json refer(const Question& at) const;
    Json outline(const Question& at) const;
    Json nameAt(const Question& at) const;
    Json indent(const Question& at) const;
    Json editsOf(const Question& at, const std::vector<TextRange>& ranges, const std::string& with) const;
    /// False: a message has come meanwhile, and nothing was reported.
    bool check(const std::string& uri, const Document& document) const;
    Json faultOf(const Diagnostic& fault, const std::string& file, std::string_view text, const TextLines& lines) const;
    void report(const std::string& uri, Json version, Json faults) const {
        Json params = {{"uri", uri}, {"diagnostics", std::move(faults)}};
        if (!version.is_null()) params["version"] = std::move(version);
        write({{"method", "textDocument/publishDiagnostics"}, {"params", std::move(params)}});
    }
    void notify(std::string why) const {
        write({{"method", "window/logMessage"}, {"params", {{"type", 1}, {"message", std::move(why)}}}});
    }
};

LanguageServer::LanguageServer(LanguageServerOptions options, std::function<void(std::string_view)> send)
    : state_(std::make_unique<State>(State{std::move(options), std::move(send), {}, {}})) {}
LanguageServer::~LanguageServer() = default;

bool LanguageServer::hasWork() const {
    return !state_->edited.empty();
}
bool LanguageServer::hasEnded() const {
    return state_->hasEnded;
}
bool LanguageServer::wasAsked() const {
    return state_->wasAsked;
}

void LanguageServer::work() {
    State& s = *state_;
    if (s.edited.empty()) return;
    const std::string uri = *s.edited.begin();
    const auto found = s.documents.find(uri);
    if (found == s.documents.end() || s.check(uri, found->second)) s.edited.erase(uri);
}

void LanguageServer::receive(std::string_view message) {
    State& s = *state_;
    if (message.size() > s.options.maximumBytes) return s.refuse(nullptr, kInvalidRequest, "the message is too long");
    if (isTooDeep(message)) return s.refuse(nullptr, kParseError, "the message is nested too deeply");
    const Json json = Json::parse(message, nullptr, false);
    if (json.is_discarded()) return s.refuse(nullptr, kParseError, "the message is no JSON");
    const Json& id = member(json, "id");
    const bool isRequest = id.is_number_integer() || id.is_string();
    if (!json.is_object() || !(member(json, "method").is_string() || json.contains("result") || json.contains("error")))
        return s.refuse(isRequest ? id : Json(), kInvalidRequest,
                        "the message is no request, notification or response");
    const std::string method = textOf(member(json, "method"));
    if (method.empty()) return;  // a response, and nothing is ever asked
    if (!isRequest && !id.is_null()) return s.refuse(nullptr, kInvalidRequest, "an id is a number or a string");
    const Json& params = member(json, "params");
    if (!isRequest) return s.notify(method, params);
    if (method == "initialize") return s.initialize(id, params);
    if (!s.isInitialized) return s.refuse(id, kNotInitialized, "the first request is initialize");
    if (s.wasAsked) return s.refuse(id, kInvalidRequest, "the server is shut down");
    if (method == "shutdown") {
        s.wasAsked = true;
        return s.answer(id, nullptr);
    }
    s.ask(id, method, params);
}

void LanguageServer::State::initialize(const Json& id, const Json& params) {
    if (isInitialized) return refuse(id, kInvalidRequest, "initialize comes once");
    isInitialized = true;
    const Json& encodings = member(member(member(params, "capabilities"), "general"), "positionEncodings");
    if (encodings.is_array()) countsBytes = std::ranges::find(encodings, Json("utf-8")) != encodings.end();
    answer(id, {{"serverInfo", {{"name", "rtsg"}}},
                {"capabilities",
                 {{"positionEncoding", countsBytes ? "utf-8" : "utf-16"},
                  {"textDocumentSync", {{"openClose", true}, {"change", 2}, {"save", true}}},
                  {"completionProvider", {{"triggerCharacters", {"<", " ", ".", "'", "\"", "{", "["}}}},
                  {"hoverProvider", true},
                  {"definitionProvider", true},
                  {"referencesProvider", true},
                  {"documentSymbolProvider", true},
                  {"renameProvider", {{"prepareProvider", true}}},
                  {"documentFormattingProvider", true},
                  {"codeActionProvider", {{"codeActionKinds", {"quickfix"}}}}}}});
}

void LanguageServer::State::notify(const std::string& method, const Json& params) {
    if (method == "exit") hasEnded = true;
    if (!isInitialized || wasAsked) return;
    if (method == "textDocument/didOpen") open(params);
    if (method == "textDocument/didChange") change(params);
    if (method == "textDocument/didClose") close(params);
    // A file that the document inlines may have been saved in another window.
    if (method == "textDocument/didSave")
        for (const auto& [uri, document] : documents) edited.insert(uri);
}

void LanguageServer::State::open(const Json& params) {
    const Json& document = member(params, "textDocument");
    const std::string uri = uriOf(params);
    if (uri.empty() || !member(document, "text").is_string())
        return notify("didOpen: it names no document, or has no text");
    if (!documents.contains(uri) && documents.size() >= options.maximumDocuments)
        return notify(fmt::format("{}: {} documents are open already", uri, documents.size()));
    documents.insert_or_assign(uri, Document{textOf(member(document, "text")), member(document, "version")});
    edited.insert(uri);
}

void LanguageServer::State::change(const Json& params) {
    const auto found = documents.find(uriOf(params));
    const Json& changes = member(params, "contentChanges");
    if (found == documents.end() || !changes.is_array()) return notify("didChange: of no open document");
    std::string& text = found->second.text;
    for (const Json& one : changes) {
        const Json& range = member(one, "range");
        if (!member(one, "text").is_string() || (!range.is_null() && !range.is_object()))
            return notify("didChange: a change has a text, and a range or none");
        const auto& with = member(one, "text").get_ref<const std::string&>();
        if (range.is_null()) {
            text = with;
            continue;
        }
        const TextLines lines(text, countsBytes);
        const std::size_t begin = lines.offsetOf(positionOf(member(range, "start")));
        const std::size_t end = std::max(begin, lines.offsetOf(positionOf(member(range, "end"))));
        if (text.size() - (end - begin) + with.size() > options.maximumBytes)
            return notify(fmt::format("{}: the document is too long", found->first));
        text.replace(begin, end - begin, with);
    }
    found->second.version = member(member(params, "textDocument"), "version");
    edited.insert(found->first);
}

void LanguageServer::State::close(const Json& params) {
    const std::string uri = uriOf(params);
    if (documents.erase(uri) == 0) return;
    edited.erase(uri);
    report(uri, nullptr, Json::array());
}

void LanguageServer::State::ask(const Json& id, const std::string& method, const Json& params) {
    using Answer = Json (State::*)(const Question&) const;
    static constexpr std::pair<std::string_view, Answer> kAnswers[] = {
        {"textDocument/completion", &State::complete},  {"textDocument/hover", &State::explain},
        {"textDocument/definition", &State::define},    {"textDocument/codeAction", &State::mend},
        {"textDocument/references", &State::refer},     {"textDocument/documentSymbol", &State::outline},
        {"textDocument/prepareRename", &State::nameAt}, {"textDocument/formatting", &State::indent},
    };
    const auto known = std::ranges::find(kAnswers, std::string_view(method), [](const auto& one) { return one.first; });
    const bool isRename = method == "textDocument/rename";
    if (known == std::end(kAnswers) && !isRename)
        return refuse(id, kMethodNotFound, fmt::format("there is no {}", method.substr(0, 80)));
    const auto found = documents.find(uriOf(params));
    if (found == documents.end()) return refuse(id, kInvalidParams, "the document is not open");
    const TextLines lines(found->second.text, countsBytes);
    const Question question{found->first, found->second.text, params, lines,
                            lines.offsetOf(positionOf(member(params, "position")))};
    if (!isRename) return answer(id, (this->*known->second)(question));
    const std::string to = textOf(member(params, "newName"));
    const auto ranges = editor::renamed(question.text, question.offset, to);
    if (!ranges) return refuse(id, kRequestFailed, ranges.error().text);
    answer(id, {{"changes", {{question.uri, editsOf(question, *ranges, to)}}}});
}

Json LanguageServer::State::editsOf(const Question& at, const std::vector<TextRange>& ranges,
                                    const std::string& with) const {
    Json edits = Json::array();
    for (const TextRange& one : ranges) edits.push_back({{"range", rangeOf(at.lines, one)}, {"newText", with}});
    return edits;
}

Json LanguageServer::State::define(const Question& at) const {
    const std::optional<TextRange> range = editor::definitionAt(at.text, at.offset);
    if (!range) return nullptr;
    return {{"uri", at.uri}, {"range", rangeOf(at.lines, *range)}};
}

Json LanguageServer::State::refer(const Question& at) const {
    const Json& wanted = member(member(at.params, "context"), "includeDeclaration");
    Json all = Json::array();
    for (const TextRange& one : editor::referencesAt(at.text, at.offset, !wanted.is_boolean() || wanted.get<bool>()))
        all.push_back({{"uri", at.uri}, {"range", rangeOf(at.lines, one)}});
    return all;
}

Json LanguageServer::State::nameAt(const Question& at) const {
    const TextRange range = editor::renamableAt(at.text, at.offset);
    return range.begin == range.end ? Json() : rangeOf(at.lines, range);
}

Json LanguageServer::State::outline(const Question& at) const {
    constexpr int kClass = 5, kObject = 19;  // the protocol's numbers
    const std::vector<editor::Symbol> symbols = editor::outlineOf(at.text);
    std::vector<std::vector<std::size_t>> children(symbols.size() + 1);  // the last: at the top
    for (std::size_t i = 0; i < symbols.size(); ++i) children[std::min(symbols[i].parent, symbols.size())].push_back(i);
    std::vector<Json> items(symbols.size());
    const auto takeAll = [&](const std::vector<std::size_t>& numbers) {
        Json all = Json::array();
        for (const std::size_t one : numbers) all.push_back(std::move(items[one]));
        return all;
    };
    for (std::size_t i = symbols.size(); i-- > 0;) {  // children have larger numbers
        const editor::Symbol& one = symbols[i];
        items[i] = {{"name", one.name.empty() ? "?" : one.name},     {"detail", one.detail},
                    {"kind", one.isProto ? kClass : kObject},        {"range", rangeOf(at.lines, one.all)},
                    {"selectionRange", rangeOf(at.lines, one.word)}, {"children", takeAll(children[i])}};
    }
    return takeAll(children.back());
}

Json LanguageServer::State::indent(const Question& at) const {
    constexpr std::uint32_t kWidest = 16;
    const Json& style = member(at.params, "options");
    const Json& spaces = member(style, "insertSpaces");
    const bool hasTabs = spaces.is_boolean() && !spaces.get<bool>();
    const std::uint32_t width = std::min(countOf(member(style, "tabSize")), kWidest);
    const std::string unit = hasTabs ? "\t" : std::string(width == 0 ? 2 : width, ' ');
    Json edits = Json::array();
    for (const editor::Indentation& one : editor::indentationOf(at.text, unit))
        edits.push_back({{"range", rangeOf(at.lines, one.replaced)}, {"newText", one.with}});
    return edits;
}

Json LanguageServer::State::complete(const Question& at) const {
    const editor::Proposals proposals = editor::proposalsAt(at.text, at.offset);
    // The protocol's numbers for a class, a field, a reference, one of an enumeration, and a keyword.
    constexpr int kKinds[] = {7, 5, 18, 20, 14};
    const Json range = rangeOf(at.lines, proposals.replaced);
    Json items = Json::array();
    for (const editor::Proposal& one : proposals.all) {
        if (items.size() >= kMaxProposals) break;
        Json item = {{"label", one.text},
                     {"kind", kKinds[static_cast<std::size_t>(one.kind)]},
                     {"textEdit", {{"range", range}, {"newText", one.text}}}};
        if (!one.detail.empty()) item["detail"] = one.detail;
        items.push_back(std::move(item));
    }
    return {{"isIncomplete", proposals.all.size() > kMaxProposals}, {"items", std::move(items)}};
}

Json LanguageServer::State::explain(const Question& at) const {
    const std::optional<editor::Explanation> said = editor::explanationAt(at.text, at.offset);
    if (!said) return nullptr;
    return {{"contents", {{"kind", "markdown"}, {"value", said->markdown}}}, {"range", rangeOf(at.lines, said->word)}};
}

/// Proposes corrections for the errors at the place where the editor asks.
Json LanguageServer::State::mend(const Question& at) const {
    Json actions = Json::array();
    const Json& faults = member(member(at.params, "context"), "diagnostics");
    if (!faults.is_array()) return actions;
    for (const Json& fault : faults) {
        const std::size_t offset = at.lines.offsetOf(positionOf(member(member(fault, "range"), "start")));
        const auto wrong = editor::misspelledWord(at.text, offset, textOf(member(fault, "message")));
        if (!wrong) continue;
        const Json edit = {{"range", rangeOf(at.lines, wrong->word)}, {"newText", wrong->meant}};
        actions.push_back({{"title", fmt::format("Replace by {}", wrong->meant)},
                           {"kind", "quickfix"},
                           {"isPreferred", true},
                           {"diagnostics", {fault}},
                           {"edit", {{"changes", {{at.uri, Json::array({edit})}}}}}});
    }
    return actions;
}

Json LanguageServer::State::faultOf(const Diagnostic& fault, const std::string& file, std::string_view text,
                                    const TextLines& lines) const {
    const bool isHere = fault.file.empty() || fault.file == file;
    std::size_t begin = isHere ? lines.offsetOf(fault.where) : 0;
    std::size_t end = std::min(text.find_first_of(" \t\r\n<>{}[]\"'=,", std::min(begin + 1, text.size())), text.size());
    if (const auto wrong = isHere ? editor::misspelledWord(text, begin, fault.text) : std::nullopt)
        begin = wrong->word.begin, end = wrong->word.end;
    const int severity = fault.severity == Severity::error ? 1 : fault.severity == Severity::warning ? 2 : 3;
    std::string message = fault.text;
    if (!isHere) {
        const std::string location =
            fault.where.line ? fmt::format(":{}:{}", fault.where.line, fault.where.column) : "";
        message = fmt::format("{}{}: {}", fault.file, location, fault.text);
    }
    return {{"range", rangeOf(lines, {begin, end})},
            {"severity", severity},
            {"code", std::string(fault.code.text())},
            {"source", "rtsg"},
            {"message", std::move(message)}};
}

bool LanguageServer::State::check(const std::string& uri, const Document& document) const {
    const std::filesystem::path file = fileOf(uri);
    const std::string name = file.empty() ? uri : file.string();
    Diagnostics faults(name), missing(name);
    const Resources resources = file.empty() ? Resources({}, options.policy) : Resources::ofFile(file, options.policy);
    {
        Scene scene;
        BuildOptions build;
        build.resources = resources;
        build.file = file;
        SceneBuilder builder(scene, faults, build);
        UrlLocations locations(builder);
        const auto filter = makeFilter("validate", locations, {faults, resources, file, options.scripts});
        Abandoned abandoned(**filter, options.isAwaited);
        (void)readDocument(document.text, abandoned, faults);
        if (abandoned.isOver()) return false;
        builder.finish();
        checkResources(scene, resources, missing, &locations);
    }
    faults.append(missing);
    const TextLines lines(document.text, countsBytes);
    Json all = Json::array();
    for (const Diagnostic& fault : faults.all()) all.push_back(faultOf(fault, name, document.text, lines));
    report(uri, document.version, std::move(all));
    return true;
}

}  // namespace rtsg
