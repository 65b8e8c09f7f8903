// PathPreview: a picture by path that receives more and more samples and is denoised where that reduces its error.
//
// Samples go to two independent halves. Each half is denoised and compared with the other: the difference that noise
// does not explain is the filter's error. A tile shows the denoised picture only if its estimated error is below that
// of the plain mean; neighbouring tiles blend into each other. Errors are those of light as it is shown, clipped at
// white. Invariant: with more and more samples the result becomes their mean. Threading: one thread at a time; it uses
// parallelFor(). Source: Rousselle et al. 2012 (two buffers); the criterion is original.
#pragma once

#include <functional>
#include <memory>

#include <rtsg/core/diagnostic.h>
#include <rtsg/renderers/picture.h>

namespace rtsg {

class PathPreview {
  public:
    /// `white` is the radiance that is shown as white; above 0.
    explicit PathPreview(float white = 1);
    ~PathPreview();
    PathPreview(PathPreview&&) noexcept;
    PathPreview& operator=(PathPreview&&) noexcept;

    void clear();
    /// Adds a picture of `samples` samples a pixel to the half that has fewer; its seed must be different from all
    /// others. Surfaces are told apart by the layers (kLayersOfDenoising) of the last picture that has them. Errors:
    /// those of denoise(); a picture of another size than the ones before.
    Result<> add(Picture picture, int samples);
    /// Samples a pixel of both halves together.
    int samples() const;
    /// The best number of samples for the next picture, at most `most`: the halves become equal soon, and then grow.
    int wanted(int maximum) const;
    /// The mean of all samples.
    Picture mean() const;
    /// The mean, denoised where that is better; without two halves, or without layers, the plain mean. `goesOn` is
    /// called from time to time; once it returns false, the results found until then are used.
    Picture best(const std::function<bool()>& goesOn = {});
    /// The share of the picture that the last best() denoised.
    double denoised() const;
    /// The root mean square of the mean's noise divided by the mean, estimated from the halves; 0 without two of them.
    double noise() const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
