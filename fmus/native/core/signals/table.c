#include "signals/table.h"

#include <stddef.h>

/* The tridiagonal equations of the spline, by Thomas' algorithm; they are diagonally dominant. */
void vi_table_bend(int count, const double time[], const double value[], double bend[])
{
    double above[VI_TABLE_ROOM];
    above[0] = bend[0] = bend[count - 1] = 0.0;
    for (int k = 1; k + 1 < count; ++k) {
        const double before = time[k] - time[k - 1], after = time[k + 1] - time[k];
        const double turn = (value[k + 1] - value[k]) / after - (value[k] - value[k - 1]) / before;
        const double pivot = 2.0 * (before + after) - before * above[k - 1];
        above[k] = after / pivot;
        bend[k] = (6.0 * turn - before * bend[k - 1]) / pivot;
    }
    for (int k = count - 2; k > 0; --k) {
        bend[k] -= above[k] * bend[k + 1];
    }
}

/* Number of instants that `time` has reached. */
static int reached(const vi_table *table, vi_twofold time, double resolution)
{
    int low = 0, high = table->count;
    while (low < high) {
        const int middle = (low + high) / 2;
        const double left = (table->time[middle] - time.high) - time.low;
        if (left <= resolution) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

/* The polynomial between instants k and k + 1, about instant k. */
static void between(const vi_table *table, int k, vi_piece *piece)
{
    const double *value = table->value + k, *bend = table->bend;
    const double span = table->time[k + 1] - table->time[k], slope = (value[1] - value[0]) / span;
    *piece = (vi_piece){.degree = 1, .coefficient = {value[0], slope}};
    if (bend != NULL) {
        piece->degree = 3;
        piece->coefficient[1] = slope - span * (2.0 * bend[k] + bend[k + 1]) / 6.0;
        piece->coefficient[2] = 0.5 * bend[k];
        piece->coefficient[3] = (bend[k + 1] - bend[k]) / (6.0 * span);
    }
}

void vi_table_piece(const vi_table *table, vi_twofold time, double resolution, vi_piece *piece)
{
    const int place = reached(table, time, resolution);
    if (place == table->count) {
        vi_piece_zero(piece, HUGE_VAL);
        return;
    }
    const double left = (table->time[place] - time.high) - time.low;
    if (place == 0) {
        vi_piece_zero(piece, left);
        return;
    }
    between(table, place - 1, piece);
    vi_piece_shift(piece, fmax(0.0, (time.high - table->time[place - 1]) + time.low));
    piece->length = left;
}
