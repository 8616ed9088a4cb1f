/* Status of a call of an FMU, as in both versions of FMI. */
#ifndef VIBROIMPACT_STATUS_H
#define VIBROIMPACT_STATUS_H

#include <stdbool.h>

enum { VI_STATUS_WARNING = 1, VI_STATUS_DISCARD = 2 };

static inline bool vi_status_is_good(int status)
{
    return status >= 0 && status <= VI_STATUS_WARNING;
}

#endif
