// TileOutputs: draws tiles of a live scene's pictures for a program that joins those of many mirrors.
//
// Steps of the scene are queued (RecordQueue), and a second scene goes through them as far as the picture that is asked
// for. Pictures are numbered by scene time, so that all mirrors mean the same state by a number; its own number and
// hash go along with each tile.
// Threading: all calls on the scene's thread; drawing has its own.
#pragma once

#include <atomic>
#include <memory>
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
    TileLink link_;                        // the thread's
    int wake_;                             // an eventfd
    double last_;                          // the scene's time before the last step
    double changed_;                       // the scene's time at the last step that changed more than that
    std::atomic<std::uint64_t> have_{0};   // the last picture whose state is whole
    std::atomic<std::uint64_t> since_{0};  // the first picture of a state after changed_; set before have_
    std::atomic<bool> failed_{false}, stop_{false};
    Result<> result_;  // the thread's until it has ended
    std::thread thread_;
};

}  // namespace rtsg
