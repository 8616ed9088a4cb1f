/* Variables of all types: parameters that outputs repeat, arrays of two structural parameters, and values that change
 * with each step. The adapters typed2.c and typed3.c move them. */
#ifndef TEST_TYPED_H
#define TEST_TYPED_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { TYPES = 12, MOST_ELEMENTS = 64, LONGEST = 6000 };
/* Types, in the order of the value references. */
typedef enum {
    FLOAT64,
    FLOAT32,
    INT8,
    UINT8,
    INT16,
    UINT16,
    INT32,
    UINT32,
    INT64,
    UINT64,
    BOOLEAN,
    STRING,
    NONE
} value_type;
/* Value references: of a type, add its number to those that end in 00. */
enum {
    ROWS = 1,
    COLUMNS,
    PARAMETER = 100,
    REPEATED = 200,
    ARRAY = 300,
    REPEATED_ARRAY = 400,
    U = 500, /* Float64, input */
    Z,       /* Float64, 2 U at once */
    X,       /* Float64, integral of U */
    WORD,    /* String, the number of steps */
    BIG,     /* Int64, 2^62 + steps */
    SINGLE,  /* Float32, input */
    MODE,    /* Enumeration, one of its items */
    SCALAR   /* Float64, input */
};

typedef union {
    double real;
    int64_t whole;
    uint64_t natural;
} cell;

/* A state: copying it saves it. */
typedef struct {
    double time; /* s */
    uint64_t rows, columns, steps;
    cell scalar[TYPES], array[TYPES][MOST_ELEMENTS];
    double u[MOST_ELEMENTS], x[MOST_ELEMENTS], single[MOST_ELEMENTS], input;
    char text[LONGEST], texts[MOST_ELEMENTS][LONGEST];
} typed;

void typed_start(typed *t);
void typed_step(typed *t, double size);
/* Number of values of a variable; 0: there is none. */
size_t typed_size(const typed *t, uint32_t reference);
value_type typed_type(uint32_t reference);
cell typed_get(const typed *t, uint32_t reference, size_t k);
/* False: the variable cannot be set. */
bool typed_set(typed *t, uint32_t reference, size_t k, cell value);
const char *typed_text(const typed *t, uint32_t reference, size_t k);
bool typed_set_text(typed *t, uint32_t reference, size_t k, const char *text);

#endif
