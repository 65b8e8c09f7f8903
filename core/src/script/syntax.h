// Whether the text of a script can be parsed; nothing of it runs.
//
// Threading: any thread. Source: ISO/IEC 19775-1 V4.0, 29.2; ECMA-262.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace rtsg::script {

struct SyntaxFault {
    std::uint32_t line = 0;  // from 1; 0 if unknown
    std::string text{};
};

/// Nothing if the text can be parsed, or if scripts are left out of this build.
std::optional<SyntaxFault> syntaxFault(const std::string& source);

}  // namespace rtsg::script
