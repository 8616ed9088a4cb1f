#include "typed.h"

#include <stdio.h>
#include <string.h>

static const int64_t modes[] = {-1, 7, 9007199254740993}; /* the items of MODE */

void typed_start(typed *t)
{
    memset(t, 0, sizeof *t);
    t->rows = 2;
    t->columns = 3;
}

void typed_step(typed *t, double size)
{
    for (size_t k = 0; k < MOST_ELEMENTS; k++) {
        t->x[k] += size * t->u[k];
    }
    t->time += size;
    t->steps++;
}

value_type typed_type(uint32_t reference)
{
    switch (reference) {
    case ROWS:
    case COLUMNS: return UINT64;
    case U:
    case Z:
    case X:
    case SCALAR: return FLOAT64;
    case SINGLE: return FLOAT32;
    case WORD: return STRING;
    case BIG:
    case MODE: return INT64;
    default: break;
    }
    return reference < PARAMETER || reference % 100 >= TYPES ? NONE : (value_type)(reference % 100);
}

size_t typed_size(const typed *t, uint32_t reference)
{
    if (typed_type(reference) == NONE) {
        return 0;
    }
    const bool is_array = (reference >= ARRAY && reference <= X) || reference == SINGLE;
    return is_array ? (size_t)(t->rows * t->columns) : 1;
}

cell typed_get(const typed *t, uint32_t reference, size_t k)
{
    switch (reference) {
    case ROWS: return (cell){.natural = t->rows};
    case COLUMNS: return (cell){.natural = t->columns};
    case U: return (cell){.real = t->u[k]};
    case Z: return (cell){.real = 2.0 * t->u[k]};
    case X: return (cell){.real = t->x[k]};
    case SINGLE: return (cell){.real = t->single[k]};
    case SCALAR: return (cell){.real = t->input};
    case BIG: return (cell){.whole = ((int64_t)1 << 62) + (int64_t)t->steps};
    case MODE: return (cell){.whole = modes[t->steps % 3]};
    default: return reference < ARRAY ? t->scalar[reference % 100] : t->array[reference % 100][k];
    }
}

bool typed_set(typed *t, uint32_t reference, size_t k, cell value)
{
    switch (reference) {
    case ROWS: t->rows = value.natural; break;
    case COLUMNS: t->columns = value.natural; break;
    case U: t->u[k] = value.real; break;
    case SINGLE: t->single[k] = value.real; break;
    case SCALAR: t->input = value.real; break;
    default:
        if (reference < PARAMETER || reference >= REPEATED_ARRAY || (reference >= REPEATED && reference < ARRAY)) {
            return false;
        }
        *(reference < ARRAY ? &t->scalar[reference % 100] : &t->array[reference % 100][k]) = value;
    }
    return t->rows <= MOST_ELEMENTS && t->columns <= MOST_ELEMENTS && t->rows * t->columns <= MOST_ELEMENTS;
}

const char *typed_text(const typed *t, uint32_t reference, size_t k)
{
    static char word[100];
    if (reference == WORD) {
        snprintf(word, sizeof word, "step %d \xc3\xa4 %%s", (int)t->steps);
        return word;
    }
    return reference < ARRAY ? t->text : t->texts[k];
}

bool typed_set_text(typed *t, uint32_t reference, size_t k, const char *text)
{
    if ((reference != PARAMETER + STRING && reference != ARRAY + STRING) || strlen(text) >= LONGEST) {
        return false;
    }
    strcpy(reference < ARRAY ? t->text : t->texts[k], text);
    return true;
}
