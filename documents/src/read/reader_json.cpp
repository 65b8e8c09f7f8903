// Elements, nodes, comments and sources of a JSON document, in the order they stand.
#include "reader_json.h"

namespace rtsg::detail {

bool JsonReader::read() {
    p_ = skipSpace(p_);
    if (at(p_) != '{') {
        complain(p_, "a JSON document of X3D is an object");
        return false;
    }
    ++p_;
    frames_.push_back({Inside::wrapper, {}, {}});
    while (!frames_.empty()) step();
    if (!finish()) {
        where_ = {1, 1};
        error("there is no X3D object in the document");
        return false;
    }
    while (feed_.more()) feed_.release(feed_.end());
    meter_.finish();
    return outline_.complete;
}

SourceLocation JsonReader::locate(const char*) {
    // The values are copies; the start of the original is near enough.
    const std::string_view name(parsedAttribute() ? parsedAttribute() : "");
    for (std::size_t i = 0; i + 1 < attributes_.size(); i += 2) {
        if (name != attributes_[i]) continue;
        const Early* early = earlyAt(i + 1);
        return early ? early->where : position_.of(valuePositions_[i / 2]);
    }
    return where_;
}

void JsonReader::step() {
    release(p_);
    const Inside inside = frames_.back().inside;
    if (inside == Inside::wrapper || inside == Inside::element) {
        std::string key;
        if (!nextMember(p_, key)) return leave();
        if (inside == Inside::element)
            member(key);
        else if (key == "#comment")
            comments();
        else if (frames_.size() == 1 && key != "X3D" && at(p_) != '{')
            p_ = valueEnd(p_);  // "$schema" and other members beside the document
        else if (!key.starts_with('#'))
            element(key, std::string(frames_.back().containerField));
        else
            p_ = valueEnd(p_);
        return;
    }
    p_ = skipSpace(p_);
    const char c = at(p_);
    if (c == '\0' || c == ']' || c == '}') return leave();
    if (c != '{') return skip(p_, "expected an object");
    if (inside == Inside::elements) return element(std::string(frames_.back().name), {});
    ++p_;
    frames_.push_back({Inside::wrapper, {}, std::string(frames_.back().containerField)});
}

void JsonReader::leave() {
    where_ = position_.of(std::min(p_, end_));
    if (there(p_)) ++p_;
    const bool isElement = frames_.back().inside == Inside::element;
    frames_.pop_back();
    if (isElement) end();
}

void JsonReader::element(const std::string& name, const std::string& containerField) {
    meter_.at(feed_.done(p_));
    const char* const object = p_;
    if (at(object) != '{') return skip(object, "expected an object for " + name.substr(0, 80));
    strings_.clear();
    valuePositions_.clear();
    early_.clear();
    SourceLocation location = position_.of(object);
    ++p_;
    const auto offset = static_cast<std::uint64_t>(object - begin_);
    if (std::ranges::binary_search(outline_.late, offset)) {
        // Its members are gone through twice, and all of it is kept until then.
        held_ = true;
        for (std::string key; nextMember(p_, key);)
            if (key.starts_with('@'))
                attribute(name, key.substr(1));
            else
                p_ = valueEnd(p_);
        p_ = object + 1;
        held_ = false;
    } else {
        attributesInFront(name);
    }
    if (!containerField.empty()) {
        strings_.emplace_back("containerField");
        strings_.push_back(containerField);
        valuePositions_.push_back(object);
    }
    attributes_.clear();
    for (const std::string& string : strings_) attributes_.push_back(string.c_str());
    const auto count = static_cast<int>(attributes_.size());
    attributes_.push_back(nullptr);
    where_ = location;
    start(name.c_str(), attributes_.data(), count);
    attributes_.clear();
    early_.clear();
    frames_.push_back({Inside::element, {}, {}});
}

void JsonReader::member(const std::string& key) {
    const char c = at(p_);
    if (key.starts_with('@')) {  // known since the element started
        p_ = valueEnd(p_);
    } else if (key == "#comment") {
        comments();
    } else if (key == "#sourceCode" || key == "#sourceText") {
        source();
    } else if (key.starts_with('-')) {
        if (c != '[' && c != '{') return skip(p_, "'" + key.substr(0, 80) + "' takes nodes");
        ++p_;
        frames_.push_back({c == '[' ? Inside::nodes : Inside::wrapper, {}, key.substr(1)});
    } else if (c == '[') {
        ++p_;
        frames_.push_back({Inside::elements, key, {}});
    } else if (c == '{') {
        element(key, {});
    } else {
        p_ = scalar(key);
    }
}

void JsonReader::comments() {
    const char c = at(p_);
    if (c == '"') return oneComment();
    if (c != '[') return skip(p_, "#comment takes strings");
    for (p_ = skipSpace(p_ + 1); there(p_) && *p_ != ']'; p_ = skipSpace(p_))
        if (*p_ == '"')
            oneComment();
        else
            p_ = std::max(valueEnd(p_), p_ + 1);
    p_ = std::min(p_ + 1, end_);
}

void JsonReader::oneComment() {
    const char* const start = p_;
    where_ = position_.of(start);
    p_ = stringEnd(start);
    comment(unescaped(start, p_));
}

void JsonReader::source() {
    beginSection();
    const char* const start = p_;
    const char c = at(p_);
    if (c == '[') {
        sourceLines();
    } else {
        p_ = valueEnd(p_);
        if (c == '"')
            text(unescaped(start, p_));
        else
            complain(start, "#sourceCode takes strings");
    }
    endSection();
}

void JsonReader::sourceLines() {
    bool first = true;
    for (p_ = skipSpace(p_ + 1); there(p_) && *p_ != ']'; p_ = skipSpace(p_)) {
        const char* const line = p_;
        p_ = std::max(valueEnd(line), line + 1);
        if (*line != '"') {
            complain(line, "#sourceCode takes strings");
            continue;
        }
        if (!first) text("\n");
        first = false;
        text(unescaped(line, p_));
    }
    p_ = std::min(p_ + 1, end_);
}

bool readJson(TextFeed& text, DocumentHandler& handler, Diagnostics& diagnostics, const ReaderOptions& options) {
    // The text is read twice, so text from a pipe is kept in between.
    std::unique_ptr<TextFeed> again = text.isComplete() ? nullptr : text.again();
    if (!again) text.fill();
    JsonOutline outline = outlineJson(again ? *again : text, again != nullptr, diagnostics, options.splitting);
    again.reset();
    return JsonReader(text, std::move(outline), handler, diagnostics, options).read();
}

}  // namespace rtsg::detail
