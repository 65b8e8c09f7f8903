// Splits the input of a source into lines, reads these, and makes senders wait, or drops lines, when too many wait.
#include "inlet.h"

#include <chrono>
#include <exception>
#include <utility>

#include <fmt/format.h>

namespace rtsg::feeds {

Inlet::Inlet(Endpoint endpoint, std::unique_ptr<LineSource> source, int call)
    : endpoint_(std::move(endpoint)), source_(std::move(source)), call_(call), faults_(endpoint_.text) {
    worker_.run(
        [this] {
            try {
                source_->read(*this, stop_.get());
            } catch (const std::exception& e) {
                broke(fmt::format("reading ended: {}", e.what()));
            }
            {
                const std::scoped_lock lock(mutex_);
                ended_ = true;
            }
            changed_.notify_all();
        },
        [this] {
            const std::scoped_lock lock(mutex_);
            changed_.notify_all();
            stop_.raise();
        });
}

std::optional<NumberedLine> Inlet::take(bool patience, const std::function<bool()>& cancelled) {
    std::unique_lock lock(mutex_);
    while (patience && waiting_.empty() && !ended_ && !(cancelled && cancelled()))
        changed_.wait_for(lock, std::chrono::milliseconds(50));
    if (waiting_.empty()) return std::nullopt;
    NumberedLine line = std::move(waiting_.front());
    waiting_.pop_front();
    bytes_ -= line.line.bytes();
    lock.unlock();
    changed_.notify_all();
    return line;
}

bool Inlet::came(std::uint64_t stream, std::string_view bytes, bool mayWait) {
    mayWait_ = mayWait;
    Stream& one = streams_[stream];
    one.splitter.add(bytes, [&](std::string_view text, bool tooLong) { read(one, text, tooLong); });
    return !worker_.stops();
}

void Inlet::paused(std::uint64_t stream, bool over) {
    const auto found = streams_.find(stream);
    if (found == streams_.end()) return;
    Stream& one = found->second;
    one.splitter.finish([&](std::string_view text, bool tooLong) { read(one, text, tooLong); });
    if (over) streams_.erase(found);
}

void Inlet::read(Stream& stream, std::string_view text, bool tooLong) {
    const std::uint64_t number = ++lines_;
    if (tooLong)
        return faults_.add("long", number, 0, DiagnosticCode("feed"),
                           [] { return fmt::format("a line of more than {} bytes", kLongestLine); });
    auto line = stream.reader.read(text);
    if (!line)
        return faults_.add("text", number, line.error().where.column, DiagnosticCode("feed"),
                           [&] { return line.error().text; });
    if (*line) push({std::move(**line), number});
}

void Inlet::push(NumberedLine line) {
    const std::size_t bytes = line.line.bytes();
    const auto isFull = [&] {
        return waiting_.size() >= Feed::kMaxWaiting || (!waiting_.empty() && bytes_ + bytes > Feed::kMaxBytes);
    };
    {
        std::unique_lock lock(mutex_);
        if (mayWait_) changed_.wait(lock, [&] { return worker_.stops() || !isFull(); });
        if (worker_.stops()) return;
        if (isFull()) {
            ++flooded_;
            return;
        }
        bytes_ += bytes;
        waiting_.push_back(std::move(line));
    }
    changed_.notify_all();
    if (call_ >= 0) ::eventfd_write(call_, 1);
}

}  // namespace rtsg::feeds
