/* The token of an FMU; "*" stands for a tool that accepts every token. */
#pragma once

#include <stdbool.h>
#include <string.h>

#include "token.h"

static inline bool is_wrong(const char *token)
{
    return strcmp(TOKEN, "*") != 0 && strcmp(token, TOKEN) != 0;
}
