/* The record: rows that an importer takes, forgets to take, or wrongly claims to have taken. */
#include "body/record.h"

#include <math.h>
#include <string.h>

#include "check.h"

static vi_record record;

static void fill(int rows)
{
    for (int n = 0; n < rows; ++n) {
        vi_record_impact(&record, n, 0.0, 1.0, 1.0, 1, 0.5);
    }
}

static void a_full_record_drops_and_counts(void)
{
    memset(&record, 0, sizeof record);
    record.impacts = 1;
    fill(VI_RECORD_CAPACITY + 100);
    CHECK(record.count == VI_RECORD_CAPACITY, "count %lld", (long long)record.count);
    CHECK(record.dropped == 100, "dropped %lld", (long long)record.dropped);
    CHECK(vi_record_full(&record), "%s", "full");
    CHECK(vi_record_unused(&record) == 0, "%s", "nothing unused");
}

static void rows_taken_leave_the_others_in_order(void)
{
    const int64_t taken[] = {-5, 0, 1, 100, VI_RECORD_CAPACITY, VI_RECORD_CAPACITY + 7, INT64_MAX};
    for (int n = 0; n < 7; ++n) {
        memset(&record, 0, sizeof record);
        record.impacts = 1;
        fill(VI_RECORD_CAPACITY);
        record.taken = taken[n];
        vi_record_take(&record);
        const int64_t gone = taken[n] < 0 ? 0 : taken[n] > VI_RECORD_CAPACITY ? VI_RECORD_CAPACITY : taken[n];
        CHECK(record.count == VI_RECORD_CAPACITY - gone, "count %lld after %lld", (long long)record.count,
              (long long)taken[n]);
        for (int64_t row = 0; row < record.count; ++row) {
            CHECK(record.rows[row * VI_RECORD_WIDTH + 1] == (double)(gone + row), "row %lld", (long long)row);
        }
    }
}

static void a_full_record_ends_a_step_once_until_it_is_emptied(void)
{
    memset(&record, 0, sizeof record);
    record.impacts = 1;
    fill(VI_RECORD_CAPACITY - VI_RECORD_RESERVE);
    CHECK(!vi_record_ends_step(&record), "%s", "room for one event");
    fill(1);
    for (int n = 0; n < 2; ++n) {
        CHECK(vi_record_ends_step(&record), "fill %d", n);
        CHECK(!vi_record_ends_step(&record), "again, fill %d", n);
        record.taken = record.count;
        vi_record_take(&record);
        fill(VI_RECORD_CAPACITY);
    }
}

static void begin_periods_of_points(int points)
{
    memset(&record, 0, sizeof record);
    record.extrema = record.periods = 1;
    record.further = points;
    for (int point = 0; point < points; ++point) {
        vi_record_point_begin(&record, point, -5.0);
    }
    vi_record_begin_step(&record, 0.0);
    for (int point = 0; point < points; ++point) {
        vi_record_point_period(&record, point, 0.1 * point, -1.0); /* no row: no period ends */
    }
    vi_record_period(&record, 2.0, 0.0, 0.0);
    CHECK(record.count == 0, "count %lld", (long long)record.count);
}

static void a_period_ends_with_a_row_of_each_further_point(void)
{
    enum { POINTS = 3 };
    begin_periods_of_points(POINTS);
    for (int point = 0; point < POINTS; ++point) {
        vi_record_point_extend(&record, point, 10.0 + point);
        vi_record_point_extend(&record, point, -10.0 - point);
        vi_record_point_period(&record, point, 7.0, 8.0);
    }
    vi_record_period(&record, 3.0, 0.0, 0.0);
    CHECK(record.count == POINTS + 1, "count %lld", (long long)record.count);
    for (int point = 0; point < POINTS; ++point) {
        const double expected[VI_RECORD_WIDTH] = {VI_ROW_FURTHER, 2.0, point + 1.0, 10.0 + point, -10.0 - point, 0.1 * point,
                                                  -1.0, 0.0};
        for (int column = 0; column < VI_RECORD_WIDTH; ++column) {
            const double found = record.rows[point * VI_RECORD_WIDTH + column];
            CHECK(found == expected[column], "point %d, column %d: %g", point, column, found);
        }
    }
    CHECK(record.rows[POINTS * VI_RECORD_WIDTH] == VI_ROW_PERIOD, "%s", "the period closes after its points");
    CHECK(record.point[1].displacement_max == 7.0 && record.point[1].displacement_min == 7.0, "%s", "the next period");
}

static void a_full_record_has_room_for_the_rows_of_all_points(void)
{
    begin_periods_of_points(VI_PORTS);
    fill(VI_RECORD_CAPACITY - VI_RECORD_RESERVE);
    CHECK(!vi_record_full(&record), "%s", "not full");
    for (int point = 0; point < VI_PORTS; ++point) {
        vi_record_point_period(&record, point, 0.0, 0.0);
    }
    vi_record_period(&record, 3.0, 0.0, 0.0);
    CHECK(record.dropped == 0, "dropped %lld", (long long)record.dropped);
}

static void any_order_of_calls_keeps_it_in_its_bounds(void)
{
    uint64_t seed = 3;
    memset(&record, 0, sizeof record);
    for (int n = 0; n < 1000000; ++n) {
        switch (choice(&seed, 12)) {
        case 0: record.impacts = (int32_t)choice(&seed, 2); break;
        case 1: record.extrema = (int32_t)choice(&seed, 2); break;
        case 2: record.periods = (int32_t)choice(&seed, 2); break;
        case 3:
            record.taken = (int64_t)choice(&seed, 600) - 40;
            vi_record_take(&record);
            break;
        case 4: vi_record_begin_step(&record, uniform(&seed, -1.0, 1.0)); break;
        case 5: vi_record_stick(&record, n, n + 1.0, 2, 0.1); break;
        case 6: vi_record_period(&record, n, 0.0, 0.0); break;
        case 7: vi_record_extend(&record, uniform(&seed, -1.0, 1.0)); break;
        case 8: vi_record_point_begin(&record, (int)choice(&seed, VI_PORTS), 0.5); break;
        case 9: vi_record_point_extend(&record, (int)choice(&seed, VI_PORTS), uniform(&seed, -1.0, 1.0)); break;
        case 10: vi_record_point_period(&record, (int)choice(&seed, VI_PORTS), 0.0, 1.0); break;
        default: fill((int)choice(&seed, 5)); break;
        }
        CHECK(record.count >= 0 && record.count <= VI_RECORD_CAPACITY, "count %lld", (long long)record.count);
        CHECK(record.displacement_max >= record.displacement_min, "%g below %g", record.displacement_max,
              record.displacement_min);
    }
}

int main(void)
{
    a_full_record_drops_and_counts();
    rows_taken_leave_the_others_in_order();
    a_full_record_ends_a_step_once_until_it_is_emptied();
    a_period_ends_with_a_row_of_each_further_point();
    a_full_record_has_room_for_the_rows_of_all_points();
    any_order_of_calls_keeps_it_in_its_bounds();
    return 0;
}
