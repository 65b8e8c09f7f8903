// TileOutputs: draws tiles of a live scene's pictures for a program that joins those of many mirrors.
//
// Steps of the scene are queued (RecordQueue), and a second scene goes through them as far as the picture that is asked
// for. Pictures are numbered by scene time, so that all mirrors mean the same state by a number; its own number and
// hash go along with each tile.
// Threading: all calls on the scene's thread; drawing has its own.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include <rtsg/core/scene.h>
#include <rtsg/session/output_maker.h>
#include <rtsg/session/tile_link.h>
#include <rtsg/sync/record_queue.h>

namespace rtsg {

class TileOutputs final : public OutputMaker {
  public:
    /// Begins with the scene's present state, and connects to the program that arguments.tiles names.
    static Result<std::unique_ptr<TileOutputs>> attach(const Scene& scene, const OutputOptions& arguments,
                                                       const Resources& resources);
    ~TileOutputs() override;

    void step(const Scene& scene, const RecordStep& step) override;
    bool wantsSteps() const override { return true; }
    Result<> frame() override { return {}; }
    bool failed() const override { return failed_; }
    Result<> finish() override;
    OutputReport report() const override;

  private:
    struct Drawer;
    TileOutputs(const OutputOptions& arguments, const Resources& resources, TileLink link);
    void run();
    Result<> follow();
    Result<> answer(Drawer& drawer, const TileLink::Message& message);
    void wake() const;

    OutputOptions arguments_;
    Resources resources_;
    RecordQueue queue_;
    TileLink link_;   // the thread's
    int wake_;        // an eventfd
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
    std::atomic<bool> failed_{false}, stop_{false};
    Result<> result_;  // the thread's until it has ended
    std::thread thread_;
};

}  // namespace rtsg
