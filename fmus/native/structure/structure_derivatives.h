/* Partial derivatives of a Structure: its own knowns and unknowns, as `column` and `row` of vi_body_form have them. */
#ifndef VIBROIMPACT_STRUCTURE_DERIVATIVES_H
#define VIBROIMPACT_STRUCTURE_DERIVATIVES_H

#include "body/modal/structure/parameter.h"

#include <stdbool.h>
#include <stddef.h>

bool vi_structure_column(void *self, size_t offset, vi_line *line);
bool vi_structure_parameter(void *self, size_t offset, vi_parameter *parameter, vi_sensitivity *of);
bool vi_structure_row(void *self, size_t offset, vi_line *line);

#endif
