// TileOutputs: draws tiles of a live scene's pictures for a program that joins those of many mirrors.
//
// A second scene goes through the queued steps as far as the picture that is asked for. Pictures are numbered by scene
// time, so that all mirrors mean the same state by a number; its own number and hash go along with each tile.
// Threading: all calls on the scene's thread; drawing has its own.
#pragma once

#include <memory>
#include <mutex>
#include <string>

#include <rtsg/core/descriptor.h>
#include <rtsg/session/tile_link.h>

#include "outputs/queued_outputs.h"

namespace rtsg {

class TileOutputs final : public QueuedOutputs {
  public:
    /// Begins with the scene's present state, and connects to the program that arguments.tiles names.
    static Result<std::unique_ptr<TileOutputs>> attach(const Scene& scene, const OutputOptions& arguments,
                                                       const Resources& resources);
    ~TileOutputs() override;

    void step(const Scene& scene, const RecordStep& step) override;
    /// Nothing more comes of a thread that has ended.
    bool failed() const override { return worker_.idle(); }
    Result<> finish() override;
    OutputReport report() const override { return {}; }

  private:
    struct Drawer;
    TileOutputs(const Scene& scene, const OutputOptions& arguments, const Resources& resources, TileLink link);
    Result<> follow() override;
    Result<> answer(Drawer& drawer, const TileLink::Message& message);

    TileLink link_;  // the thread's
    Wakeup wake_;
    double last_;     // the scene's time before the last step
    double changed_;  // the scene's time at the last step that changed more than that
    /// The last picture whose state is whole.
    struct Have {
        std::uint64_t number = 0, since = 0;  // `since`: the first picture of a state after changed_
        std::string state;                    // the number and hash; empty: unknown whether it is the first of its time
    };
    std::string lastState_;  // at the last step, as in Have
    std::mutex mutex_;       // guards the next member
    Have have_;
};

}  // namespace rtsg
