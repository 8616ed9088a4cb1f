/* A signal by its values at ascending instants: linear between them, or a natural cubic spline. */
#ifndef VIBROIMPACT_TABLE_H
#define VIBROIMPACT_TABLE_H

#include "signals/piece.h"

/* Most instants of a table. */
enum { VI_TABLE_ROOM = 8192 };

/* A view of a table; its arrays belong to the caller. */
typedef struct {
    int count;           /* of instants, 2 to VI_TABLE_ROOM */
    const double *time;  /* s, ascending */
    const double *value;
    const double *bend;  /* second derivatives of the spline at the instants; NULL: linear */
} vi_table;

/* Find the second derivatives of the natural cubic spline. */
void vi_table_bend(int count, const double time[], const double value[], double bend[]);

/* The piece at `time`, on the clock of the table; 0 before its first instant and from its last one on. resolution:
 * seconds before an instant at which the next piece begins. */
void vi_table_piece(const vi_table *table, vi_twofold time, double resolution, vi_piece *piece);

#endif
