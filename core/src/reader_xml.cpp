#include "reader_common.h"

namespace rtsg::detail {

bool readXml(std::string_view, DocumentHandler&, Diagnostics& diagnostics, const ReaderProgress&) {
    diagnostics.error({1, 1}, "the XML encoding is not read yet");
    return false;
}

}  // namespace rtsg::detail
