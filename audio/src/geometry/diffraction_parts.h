// DiffractionParts: switches for the mechanisms of diffraction, for measurements of what each contributes.
//
// Nothing else in the library changes them. Threading: change them while nothing is traced and no wall changes.
#pragma once

namespace rtsg {

struct DiffractionParts {
    bool images = true;       // mirror images of first order bend
    bool roundBodies = true;  // cylinders and spheres are round; else their facets have edges
    bool smallBodies = true;  // bodies that are small compared with a wave length let it pass
    bool hiddenParts = true;  // edges that something hides in part bend as far as they are seen
};

inline DiffractionParts& diffractionParts() {
    static DiffractionParts parts;
    return parts;
}

}  // namespace rtsg
