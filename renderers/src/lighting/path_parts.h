// PathParts: what the path tracer does to be quick, each of which a measurement may leave out to see what it is worth.
//
// Invariant: pictures have the same mean with and without; only how soon they are known differs. Nothing else of the
// library writes it. Threading: written while no picture is made.
#pragma once

namespace rtsg::trace {

struct PathParts {
    bool emitters = true;    // shining triangles are asked directly; else bounces alone find them
    bool lightTree = true;   // which of them, by what they can do for the point; else each as likely
    bool skyLight = true;    // an uneven sky is asked directly; else bounces alone find it
    bool wavefronts = true;  // in stages, where goesInWavefronts(); else packet by packet
    bool largeFirst = true;  // of those, a few large triangles before all trees, where LargeRays pay
    float roulette = .25f;   // the weight, of the first one's, below which Russian roulette begins
};

inline PathParts& pathParts() {
    static PathParts parts;
    return parts;
}

}  // namespace rtsg::trace
