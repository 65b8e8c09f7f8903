#include <rtsg/core/diagnostic.h>

namespace rtsg {

std::string Diagnostic::format() const {
    std::string result = file;
    if (where.line) {
        if (!result.empty()) result += ':';
        result += std::to_string(where.line);
        if (where.column) result += ':' + std::to_string(where.column);
    }
    if (!result.empty()) result += ": ";
    switch (severity) {
        case Severity::note:
            result += "note: ";
            break;
        case Severity::warning:
            result += "warning: ";
            break;
        case Severity::error:
            result += "error: ";
            break;
    }
    return result + text;
}

void Diagnostics::add(Severity severity, SourceLocation where, std::string text) {
    errors_ += severity == Severity::error;
    warnings_ += severity == Severity::warning;
    if (all_.size() >= limit_) {
        ++dropped_;
        return;
    }
    all_.push_back({severity, file_, where, std::move(text)});
}

void Diagnostics::append(const Diagnostics& other) {
    const std::size_t count = other.all_.size();  // fixed before the loop: `other` may be this very collection
    errors_ += other.errors_;
    warnings_ += other.warnings_;
    dropped_ += other.dropped_;
    for (std::size_t i = 0; i < count; ++i) {
        if (all_.size() >= limit_) {
            ++dropped_;
            continue;
        }
        Diagnostic copy = other.all_[i];
        all_.push_back(std::move(copy));
    }
}

}  // namespace rtsg
