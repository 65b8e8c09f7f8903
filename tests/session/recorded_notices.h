// Notices that keep what a session says, and interrupt it on demand.
//
// Threading: report() comes from threads of outputs, too.
#pragma once

#include <atomic>
#include <mutex>
#include <string>
#include <vector>

#include <rtsg/session/notices.h>

namespace rtsg::test {

class RecordedNotices final : public Notices {
  public:
    void report(const Diagnostic& diagnostic) override { keep(diagnostic.format()); }
    void report(const Diagnostics& diagnostics, std::string_view) override {
        for (const Diagnostic& d : diagnostics.all()) keep(d.format());
    }
    void note(std::string_view text) override { keep(std::string(text)); }
    bool interrupted() const override { return isInterrupted; }
    void leftOut() override { ++missing; }
    void damaged(const std::string&, std::size_t errors) override { damage = errors; }

    /// All that was said, one line each.
    std::string said() const {
        const std::scoped_lock lock(mutex_);
        return all_;
    }
    SessionContext context() { return {this, nullptr}; }

    std::atomic<bool> isInterrupted = false;
    std::atomic<int> missing = 0;
    std::atomic<std::size_t> damage = 0;

  private:
    void keep(const std::string& line) {
        const std::scoped_lock lock(mutex_);
        all_ += line + "\n";
    }
    mutable std::mutex mutex_;
    std::string all_;
};

}  // namespace rtsg::test
