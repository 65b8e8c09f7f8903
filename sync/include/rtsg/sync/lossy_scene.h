// LossyScene: a second scene that follows another one and differs from it by a stated error at most, and only where
// values are in motion. Mirrors and logs attach to it as to any scene; so a lossy stream is a lossless stream of this
// scene, its hashes are this scene's, and everybody who follows still compares them bit for bit.
//
// Invariant: a value that was changed in one of the two frames before lies on a grid, its distance from the origin's at
// most maxError (Euclidean for vectors, the angle between rotations); it is taken from the origin's value alone, so
// errors do not add up. What has rested for two frames is exact, as are first changes, and all types but those of f32.
// Threading: the origin scene's thread.
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
    /// `origin` must outlive this. `maxError`: metres, radians, or the field's own unit; finite and > 0.
    static Result<std::unique_ptr<LossyScene>> follow(Scene& origin, double maxError);
    ~LossyScene() override;

    /// In step with the origin after each of its frames, with the same sequence numbers. Not to be edited.
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
