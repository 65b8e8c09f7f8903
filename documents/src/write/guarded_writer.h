// GuardedWriter: a writer whose exceptions end what it writes, and nothing else.
//
// Writers may come from plug-ins. Invariant: after the first exception the writer hears of nothing more, and state()
// says why. Threading: one thread a writer.
#pragma once

#include <exception>

#include <rtsg/documents/dialect.h>
#include <rtsg/documents/filter.h>

namespace rtsg::detail {

class GuardedWriter final : public EachCommand<GuardedWriter> {
  public:
    GuardedWriter(const FormatWriter& format, TextSink sink, Diagnostics& diagnostics);
    /// The failure of the writer, if it has failed.
    const Result<>& state() const { return state_; }

  private:
    friend EachCommand<GuardedWriter>;
    template <class Call>
    void pass(const Call& call) {
        if (!state_) return;
        try {
            call(*writer_);
        } catch (const std::exception& e) {
            noteFailure(e.what());
        } catch (...) {
            noteFailure("it says not why");
        }
    }
    void noteFailure(std::string_view why);

    std::string format_;
    std::unique_ptr<DocumentHandler> writer_;
    Result<> state_;
};

}  // namespace rtsg::detail
