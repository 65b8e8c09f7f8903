// The profiles of X3D and the components that this build knows.
//
// Threading: pure functions. Source: ISO/IEC 19775-1 V4.0, annexes A to H.
#pragma once

#include <string>
#include <vector>

#include <rtsg/documents/document_handler.h>

namespace rtsg {

/// The components and profiles that this build knows: a component with the highest level of any node in it, a profile
/// with its components.
struct Profile {
    std::string name;
    std::vector<DocumentHead::Component> components;
};
std::vector<DocumentHead::Component> supportedComponents();
std::vector<Profile> supportedProfiles();

}  // namespace rtsg
