// Inlet: reads a source on a thread of its own, and keeps the lines that came until the scene takes them.
//
// Invariant: lines that wait are bounded in number and bytes (Feed::kMaxWaiting, kMaxBytes).
// Threading: the scene's thread calls; another one reads.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/core/descriptor.h>
#include <rtsg/core/worker.h>
#include <rtsg/feeds/feed.h>

#include "faults.h"
#include "lines/feed_line.h"
#include "lines/line_splitter.h"
#include "sockets/line_source.h"

namespace rtsg::feeds {

struct NumberedLine {
    FeedLine line;
    std::uint64_t number = 0;  // of the line, from 1, in the order in which lines came
};

class Inlet final : private LineTaker {
  public:
    /// `waits`: lines of the source wait for the scene, so none is left out.
    Inlet(Endpoint endpoint, std::unique_ptr<LineSource> source, int call);

    /// The next line. With `patience`, waits for it until the source ends or `cancelled`.
    std::optional<NumberedLine> take(bool patience, const std::function<bool()>& cancelled);
    /// A line is there.
    bool waits() {
        const std::scoped_lock lock(mutex_);
        return !waiting_.empty();
    }
    const std::string& name() const { return endpoint_.text; }
    Faults& faults() { return faults_; }
    std::uint64_t lines() const { return lines_; }
    std::uint64_t flooded() const { return flooded_; }
    bool isFile() const { return source_->isFile(); }
    bool isBroken() const { return broken_; }

  private:
    struct Stream {
        LineSplitter splitter;
        FeedReader reader;
    };
    bool came(std::uint64_t stream, std::string_view bytes, bool mayWait) override;
    void paused(std::uint64_t stream, bool over) override;
    void lost(std::uint64_t datagrams) override { flooded_ += datagrams; }
    void note(std::string text) override { faults_.note(std::move(text)); }
    void broke(std::string text) override {
        broken_ = true;
        faults_.note(std::move(text));
    }
    void read(Stream& stream, std::string_view text, bool tooLong);
    void push(NumberedLine line);

    Endpoint endpoint_;
    std::unique_ptr<LineSource> source_;
    const int call_;
    Wakeup stop_;
    Faults faults_;
    std::map<std::uint64_t, Stream> streams_;  // the reading thread's
    bool mayWait_ = false;                     // the reading thread's
    std::atomic<std::uint64_t> lines_{0}, flooded_{0};
    std::atomic<bool> broken_{false};

    std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<NumberedLine> waiting_;
    std::size_t bytes_ = 0;
    bool ended_ = false;
    Worker worker_{"rtsg feed"};  // last: it uses all the rest
};

}  // namespace rtsg::feeds
