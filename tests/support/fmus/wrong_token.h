/* The token of an FMU; that of a tool that looks at none is "*". */
#pragma once

#include <stdbool.h>
#include <string.h>

#include "token.h"

static inline bool is_wrong(const char *token)
{
    return strcmp(TOKEN, "*") != 0 && strcmp(token, TOKEN) != 0;
}
