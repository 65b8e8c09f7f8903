// PathPreview: a picture by path that goes on getting samples, denoised wherever that brings it nearer to the truth.
//
// Samples go to two halves, which are independent of each other. So either one, denoised, is judged by the other: what
// it is further from than noise explains is the filter's fault. A tile shows the denoised picture only where its error,
// so estimated, is below that of the plain mean; between tiles one goes over into the other. Errors are of light as it
// is shown, cut at white. Invariant: with ever more samples it becomes their mean. Threading: one thread at a time;
// uses parallelFor(). Source: Rousselle et al. 2012 (two buffers); the criterion is this file's own.
#pragma once

#include <functional>
#include <memory>

#include <rtsg/core/diagnostic.h>
#include <rtsg/renderers/picture.h>

namespace rtsg {

class PathPreview {
  public:
    /// `white`: the light that is shown as white; above 0.
    explicit PathPreview(float white = 1);
    ~PathPreview();
    PathPreview(PathPreview&&) noexcept;
    PathPreview& operator=(PathPreview&&) noexcept;

    void clear();
    /// Adds a picture of `samples` samples a pixel to the half that has fewer; its seed must be its own. Surfaces are
    /// told by the layers (kLayersOfDenoising) of the last one that has them. Errors: those of denoise(); a picture of
    /// another size than the ones before.
    Result<> add(Picture picture, int samples);
    /// A pixel; of both halves.
    int samples() const;
    /// How many the next picture best has, of `most` at most: so that halves are soon equal, and grow.
    int wanted(int most) const;
    /// The mean of all samples.
    Picture mean() const;
    /// That, denoised where it is better. Without two halves, or layers, it is the mean. `goesOn`: asked now and then;
    /// once it says no, what was found out before counts.
    Picture best(const std::function<bool()>& goesOn = {});
    /// Of the last best(): the share of the picture that was denoised.
    double denoised() const;
    /// The root mean square of the mean's noise over the mean, as the halves tell; 0 without two of them.
    double noise() const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
