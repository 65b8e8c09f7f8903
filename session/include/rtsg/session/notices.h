// Notices: what a running session says to whoever runs it, and what it asks; the library prints nothing itself.
//
// SessionContext hands them on together with the plug-ins. Every function does nothing unless it is overridden, so a
// program overrides what it shows.
// Threading: report() and interrupted() are called on the threads of outputs, too; the others on the session's thread.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include <rtsg/core/diagnostic.h>
#include <rtsg/plugins/extensions.h>

namespace rtsg {

class Notices {
  public:
    virtual ~Notices() = default;
    /// Something failed, or is worth a warning; the session goes on.
    virtual void report(const Diagnostic& diagnostic) { (void)diagnostic; }
    /// The diagnostics of a part that has ended. `known`: the text of a subscriber's failure that was returned, too.
    virtual void report(const Diagnostics& diagnostics, std::string_view known) { (void)diagnostics, (void)known; }
    /// A line for people: an edit was followed, a log has begun.
    virtual void note(std::string_view text) { (void)text; }
    /// Shows the progress of work that may take long; an empty function: nobody looks.
    virtual std::function<void(std::uint64_t done, std::uint64_t total)> progress(const std::string& work) {
        (void)work;
        return {};
    }
    /// True from the moment on when all work shall end in order.
    virtual bool interrupted() const { return false; }
    /// Something that was asked for is not there, which has been reported.
    virtual void leftOut() {}
    /// The file of a scene and its Inlines had so many errors so far; the scene was made of the rest.
    virtual void damaged(const std::string& file, std::size_t errors) { (void)file, (void)errors; }
};

/// The code of an error of the caller's: values that make no sense, or exclude each other.
inline constexpr DiagnosticCode kUsageCode{"usage"};

/// Whom a session tells, and the plug-ins that it uses. Both must outlive the session; null stands for none.
struct SessionContext {
    Notices* notices = nullptr;
    const Extensions* plugins = nullptr;

    void report(const Diagnostic& diagnostic) const { reported().report(diagnostic); }
    void report(const Diagnostics& diagnostics, std::string_view known = {}) const {
        reported().report(diagnostics, known);
    }
    void note(std::string_view text) const { reported().note(text); }
    auto progress(const std::string& work) const { return reported().progress(work); }
    bool interrupted() const { return reported().interrupted(); }
    void leftOut() const { reported().leftOut(); }
    void damaged(const std::string& file, std::size_t errors) const { reported().damaged(file, errors); }
    const Extensions& extensions() const;

  private:
    Notices& reported() const;
};

}  // namespace rtsg
