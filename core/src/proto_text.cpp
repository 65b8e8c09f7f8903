#include "builder_state.h"

namespace rtsg {

std::string declarationText(const ProtoDeclaration&) {
    return {};
}

}  // namespace rtsg
