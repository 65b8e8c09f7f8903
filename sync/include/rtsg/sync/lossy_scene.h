// LossyScene: a second scene that follows another one. It differs from it only in values in motion, and by at most a
// stated error. Mirrors and logs attach to it as to any scene. So a lossy stream is a lossless stream of this scene:
// the hashes are this scene's, and all followers still compare them bit for bit.
//
// Invariant: a value that changed in one of the last two frames lies on a grid, at most maxError from the origin's
// value (Euclidean distance for vectors, angle for rotations). It is computed from the origin's value alone, so errors
// do not add up. Values that have rested for two frames are exact, and so are first changes and all types that are not
// made of f32. Threading: the origin scene's thread.
#pragma once

#include <cstdint>
#include <memory>

#include <rtsg/core/scene.h>

namespace rtsg {

struct LossyStatistics {
    std::uint64_t onGrid = 0;   // values in motion that were rounded
    std::uint64_t exact = 0;    // values that went as they are
    std::uint64_t settled = 0;  // exact values sent because the field came to rest
};

class LossyScene : public Subscriber {
  public:
    /// `origin` must outlive the result. `maxError` is in metres, radians, or the field's own unit; it must be finite
    /// and > 0.
    static Result<std::unique_ptr<LossyScene>> follow(Scene& origin, double maxError);
    ~LossyScene() override;

    /// The scene to serve or log. It is in step with the origin after each frame, with the same state numbers. Do not
    /// edit it.
    Scene& scene();
    double maxError() const;
    const LossyStatistics& statistics() const;

    Result<> apply(const Scene& origin, const ChangeSet& changes) override;
    std::string subscriberName() const override { return "lossy scene"; }

  private:
    struct State;
    explicit LossyScene(double maxError);
    std::unique_ptr<State> state_;
};

}  // namespace rtsg
