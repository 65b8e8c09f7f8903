// What stands for notices that nobody wants, and for plug-ins where there are none.
#include <rtsg/session/notices.h>

namespace rtsg {

Notices& SessionContext::reported() const {
    static Notices nobody;  // has no state
    return notices ? *notices : nobody;
}

const Extensions& SessionContext::extensions() const {
    static const Extensions none;
    return plugins ? *plugins : none;
}

}  // namespace rtsg
