#!/usr/bin/env bash
# Makes the pictures of README and docs anew: of the shipped clip, and of the oak too if CLIPS names a folder that
# holds oak_release/video.mkv and outline.json (by default $ARBORCAM_CLIPS). ONLY=name makes one group: views, film, shapes,
# wind, grown, sketch, photo, cloud, markers, hu, forest, points, terminal, page, sheets. The sheets (film, wood, traced branches, skeleton and model of each
# clip) go to out/;
# without CLIPS the second is of a film made anew, for which, and for `grown`, `photo`, `markers` and `hu`, PYTHON (python3) needs numpy, scipy and opencv.
# WOOD names a built bench `wood`. Needs what scripts/apt-packages-test.txt lists, and `make build` first.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

arborcam=$PWD/target/release/arborcam
to=$PWD/docs/pictures
clips=${CLIPS:-${ARBORCAM_CLIPS:-}}
python=${PYTHON:-python3}
only=${ONLY:-}
largest=150000 # bytes of a picture
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

fail() {
    printf 'pictures: %s\n' "$*" >&2
    exit 1
}

for tool in ffmpeg tmux "$python"; do
    command -v "$tool" >/dev/null || fail "$tool is not installed; run scripts/setup.sh --tests"
done
"$python" -c 'import PIL' 2>/dev/null || fail "$python has no PIL; run scripts/setup.sh --tests"
[[ -x $arborcam ]] || fail "$arborcam is not there; run \`make build\` first"
mkdir -p "$to"

trees=(winter)
declare -A film=([winter]=recordings/sparse_winter.mkv) outline=([winter]=recordings/sparse_winter.outline.json)
if [[ -n $clips ]]; then
    film[oak]=$clips/oak_release/video.mkv outline[oak]=$clips/oak_release/outline.json
    [[ -r ${film[oak]} && -r ${outline[oak]} ]] || fail "$clips holds no oak_release/video.mkv with outline.json"
    trees+=(oak)
else
    echo "pictures: neither CLIPS nor ARBORCAM_CLIPS is given; those of the oak stay as they are"
fi

# Whether a group of pictures is wanted.
wanted() { [[ -z $only || $only == "$1" ]]; }

# Captures TREE once.
capture() {
    [[ -d $work/$1 ]] || "$arborcam" replay "${film[$1]}" --outline "${outline[$1]}" --fast --headless --out "$work/$1" \
        2>"$work/$1.log" || fail "the replay of ${film[$1]} failed: $(tail -n 1 "$work/$1.log")"
}

# render TREE FILE OPTIONS...
render() {
    local tree=$1 out=$2
    shift 2
    capture "$tree"
    rm -f "$out"
    "$arborcam" render "$work/$tree" --out "$out" "$@" 2>"$work/render.log" ||
        fail "render $* failed: $(cat "$work/render.log")"
}

# row FILE PICTURES...: side by side, with as many colours as the size allows.
row() {
    local out=$1 colours inputs=() n
    shift
    n=$#
    local stack="hstack=inputs=$n"
    ((n > 1)) || stack=copy
    for picture in "$@"; do inputs+=(-i "$picture"); done
    for colours in 256 96 48 24; do
        ffmpeg -v error -nostdin -y "${inputs[@]}" -filter_complex \
            "$stack,split[a][b];[a]palettegen=max_colors=$colours:reserve_transparent=0[p];[b][p]paletteuse=dither=none" \
            -frames:v 1 "$out"
        (($(stat -c %s "$out") <= largest)) && break
    done
    told "$out"
}

told() {
    local bytes
    bytes=$(stat -c %s "$1")
    ((bytes <= largest)) || fail "$1 has $bytes bytes, more than $largest"
    printf 'pictures: %-28s %4d kB\n' "${1#"$PWD/"}" $((bytes / 1000))
}

# The tree from front, side and top, leafless and in leaf.
views() {
    local tree
    for tree in "${trees[@]}"; do
        for view in front side top; do
            render "$tree" "$work/$tree-bare-$view.png" --view $view --size 320x320 --bare
            render "$tree" "$work/$tree-leaf-$view.png" --view $view --size 320x320
        done
        row "$to/$tree-bare.png" "$work/$tree"-bare-{front,side,top}.png
        # A tree that was filmed without leaves has none.
        if cmp -s "$work/$tree-bare-front.png" "$work/$tree-leaf-front.png"; then
            echo "pictures: $tree has no leaves"
        else
            row "$to/$tree-leaf.png" "$work/$tree"-leaf-{front,side,top}.png
        fi
    done
    render winter "$work/front.png" --size 480x500
    render winter "$work/side.png" --view side --size 480x500
    row "$to/model.png" "$work/front.png" "$work/side.png"
}

# The film beside the model in the same frame.
film_beside() {
    local tree quality
    for tree in "${trees[@]}"; do
        render "$tree" "$work/beside.png" --film beside
        for quality in 3 5 8; do
            ffmpeg -v error -nostdin -y -i "$work/beside.png" -q:v $quality -frames:v 1 "$to/$tree-film.jpg"
            (($(stat -c %s "$to/$tree-film.jpg") <= largest)) && break
        done
        told "$to/$tree-film.jpg"
    done
}

# One tree pushed into five shapes.
shapes() {
    local tree=winter shape
    [[ -n $clips ]] && tree=oak
    for shape in triangle circle pentagon heart vase; do
        render "$tree" "$work/shaped-$shape.png" --size 256x288 --envelope "docs/shapes/$shape.png" --leaves on
    done
    row "$to/topiary.png" "$work"/shaped-{triangle,circle,pentagon,heart,vase}.png
}

# grow NAME EXAMPLE OPTIONS...: trees like an example, which lies below $work too.
grow() {
    local name=$1 example=$2
    shift 2
    "$arborcam" grow "$work/$example" --motion none --out "$work/$name" "$@" 2>"$work/grow.log" ||
        fail "grow of $example failed: $(tail -n 1 "$work/grow.log")"
}

# A tree and new ones like it: of the same forks, and of the same branches at freer and freer angles, and from lower and
# lower levels on. The forks of both as points in triangles.
grown() {
    local threshold level tree
    capture winter
    grow offspring winter --count 8
    for threshold in 0.6 0.4 0.2; do
        grow "turned-$threshold" winter --count 1 --like von-mises --threshold "$threshold"
    done
    for level in 4 3 2; do
        grow "from-$level" winter --count 1 --like von-mises --from-level "$level"
    done
    for tree in winter offspring/tree-000{1..8} turned-{0.6,0.4,0.2}/tree-0001 from-{4,3,2}/tree-0001; do
        render_made "$tree"
    done
    row "$to/grown.png" "$work"/made-winter.png "$work"/made-offspring-tree-000{1..8}.png
    row "$to/turned.png" "$work"/made-winter.png "$work"/made-turned-{0.6,0.4,0.2}-tree-0001.png
    row "$to/turned-from.png" "$work"/made-winter.png "$work"/made-from-{4,3,2}-tree-0001.png
    "$python" scripts/pictures.py triangles "$work/winter" "$work/offspring" "$to/triangles.png"
    told "$to/triangles.png"
}

# Two sketches, what becomes of them, and what is grown of the first.
sketch() {
    local name tree
    for name in tree conifer; do
        "$arborcam" sketch "docs/sketches/$name.svg" --out "$work/drawn-$name" 2>"$work/sketch.log" ||
            fail "sketch of $name failed: $(tail -n 1 "$work/sketch.log")"
        "$python" scripts/pictures.py drawing "docs/sketches/$name.svg" 288 "$work/drawing-$name.png"
        render_made "drawn-$name"
        render_made "drawn-$name" side
    done
    grow from-sketch drawn-tree --count 3
    for tree in from-sketch/tree-000{1,2,3}; do
        render_made "$tree"
    done
    row "$to/sketch.png" "$work/drawing-tree.png" "$work"/made-drawn-tree{,-side}.png \
        "$work"/made-from-sketch-tree-000{1,2,3}.png
    row "$to/sketch-conifer.png" "$work/drawing-conifer.png" "$work"/made-drawn-conifer{,-side}.png
}

# photographed NAME OPTIONS...: what `arborcam photo` makes, below $work.
photographed() {
    local name=$1
    shift
    "$arborcam" photo "$@" --out "$work/$name" 2>"$work/photo.log" || fail "photo of $name failed: $(tail -n 1 "$work/photo.log")"
}

# made_photo NAME SEED bare|leaves OPTIONS...: a made photograph below $work.
made_photo() {
    local name=$1
    shift
    "$python" benches/made_photos.py "$work" "$name" "$@" ||
        fail "no photograph could be made; see the head of benches/made_photos.py for what PYTHON needs"
}

# seen NAME VIEW [SIZE]: draws a photographed tree or wood to seen-NAME-VIEW.png.
seen() {
    rm -f "$work/seen-$1-$2.png"
    "$arborcam" render "$work/$1" --size "${3:-256x256}" --view "$2" --out "$work/seen-$1-$2.png" 2>"$work/render.log" ||
        fail "render of $1 failed: $(cat "$work/render.log")"
}

# photo_sheet OUT NAME PICTURE STROKES: photograph, masks, branches, front and side of one tree.
photo_sheet() {
    "$python" scripts/pictures.py photo "$3" "$4" "$work/$2" 256 "$work/strokes-$2.png"
    seen "$2" front
    seen "$2" side
    row "$1" "$work"/{strokes-$2,seen-$2-front,seen-$2-side}.png
}

# Trees of photographs: one bare, one in leaf, one with and without attractors in space, several in one picture, frames of the clips,
# and one that sways like a captured one.
photo() {
    local seed look made tree folders files k
    for seed in 32005 32002 32008 32009; do
        look=bare
        ((seed % 2)) || look=leaves
        made=$work/photo-$seed
        made_photo "photo-$seed" "$seed" "$look"
        photographed "of-$seed" "$made/photo.jpg" --crown "$made/crown.json" --branch "$made/trunk.json"
        photo_sheet "$work/sheet-$seed.png" "of-$seed" "$made/photo.jpg" "$made/crown.json,$made/trunk.json"
    done
    cp "$work/sheet-32005.png" "$to/photo-bare.png"
    cp "$work/sheet-32002.png" "$to/photo-leaves.png"
    column "$to/photo-four.png" "$work"/sheet-{32002,32005,32008,32009}.png
    made=$work/photo-32002
    photographed in-picture "$made/photo.jpg" --crown "$made/crown.json" --branch "$made/trunk.json" --attractors picture
    for tree in in-picture of-32002; do seen "$tree" side; done
    row "$to/photo-space.png" "$work"/seen-{of-32002-front,in-picture-side,of-32002-side}.png
    for look in leaves bare; do
        made=$work/wood-$look seed=36001
        [[ $look == leaves ]] || seed=36003
        made_photo "wood-$look" "$seed" "$look" --trees 4
        files=() folders=
        for k in 1 2 3 4; do files+=(--tree "$made/tree-$k.json"); done
        photographed "scene-$look" "$made/photo.jpg" "${files[@]}" --horizon 591
        for k in 1 2 3 4; do folders+=${folders:+,}$work/scene-$look/tree-000$k; done
        "$python" scripts/pictures.py photo "$made/photo.jpg" "$(printf '%s,' "$made"/tree-?.json)" "$folders" 224 "$work/strokes-$look.png"
        seen "scene-$look" front 600x320
        seen "scene-$look" turntable 594x320
        row "$work/views-$look.png" "$work"/seen-scene-$look-{front,turntable}.png
        column "$to/photo-wood-$look.png" "$work/strokes-$look.png" "$work/views-$look.png"
    done
    for tree in "${trees[@]}"; do
        photographed "clip-$tree" "${film[$tree]}" --frame 0 --crown "${outline[$tree]}" --branch "docs/sketches/$tree-trunk.json"
        photo_sheet "$to/photo-clip-$tree.png" "clip-$tree" "$work/clip-$tree/frame.jpg" "${outline[$tree]},docs/sketches/$tree-trunk.json"
    done
    sway_beside
}

# The captured winter tree, and a photographed one like it, in the same wind.
sway_beside() {
    local made=$work/photo-32005 tree
    capture winter
    photographed like-winter "$made/photo.jpg" --crown "$made/crown.json" --branch "$made/trunk.json" --like "$work/winter"
    for tree in winter like-winter; do
        "$arborcam" animate "$work/$tree" --wind 7 --seconds 3 --loop --size 176x176 --out "$work/$tree.mp4" 2>"$work/animate.log" ||
            fail "animate of $tree failed: $(tail -n 1 "$work/animate.log")"
    done
    ffmpeg -v error -nostdin -y -i "$work/winter.mp4" -i "$work/like-winter.mp4" -filter_complex \
        "hstack=inputs=2,fps=6,split[a][b];[a]palettegen=max_colors=8[p];[b][p]paletteuse=dither=none" "$to/photo-sway.gif"
    told "$to/photo-sway.gif"
}

# column OUT PICTURES...: one below the other, as wide as the first.
column() {
    local out=$1 inputs=() scaled= n=0 width picture
    shift
    width=$(ffprobe -v error -show_entries stream=width -of csv=p=0 "$1")
    for picture in "$@"; do
        inputs+=(-i "$picture")
        scaled+="[$n]scale=$width:-2[s$n];"
        n=$((n + 1))
    done
    for k in $(seq 0 $((n - 1))); do scaled+="[s$k]"; done
    local colours
    for colours in 256 96 48 24 12; do
        ffmpeg -v error -nostdin -y "${inputs[@]}" -filter_complex \
            "${scaled}vstack=inputs=$n,split[a][b];[a]palettegen=max_colors=$colours:reserve_transparent=0[p];[b][p]paletteuse=dither=none" \
            -frames:v 1 "$out"
        (($(stat -c %s "$out") <= largest)) && break
    done
    told "$out"
}

# A scan beside its tree from the front, and the tree from the side.
cloud() {
    local seed=41001
    "$python" benches/made_clouds.py "$work" cloud "$seed" || fail "no cloud could be made; see the head of benches/made_clouds.py"
    "$arborcam" cloud "$work/cloud/cloud.ply" --out "$work/scanned" 2>"$work/cloud.log" ||
        fail "cloud failed: $(tail -n 1 "$work/cloud.log")"
    "$python" scripts/pictures.py cloud "$work/cloud/cloud.ply" "$work/scanned" 256 "$work/cloud-points.png"
    for view in front side; do
        "$arborcam" render "$work/scanned" --size 256x256 --view "$view" --out "$work/scanned-$view.png" 2>"$work/render.log" ||
            fail "render of the scan failed: $(cat "$work/render.log")"
    done
    row "$to/cloud.png" "$work"/{cloud-points,scanned-front,scanned-side}.png
}

# A made film with coloured markers, one of which a board hides for a second.
markers() {
    local film=$work/marked
    "$python" benches/made_films.py "$work" marked 46003 bare held --markers 10 --seconds 13.634 ||
        fail "no film with markers could be made; see the head of benches/made_films.py for what PYTHON needs"
    "$arborcam" replay "$film/video.mkv" --outline "$film/outline.json" --markers "$film/markers.json" --fast --headless \
        --out "$work/marked-tree" 2>"$work/marked.log" || fail "the replay with markers failed: $(tail -n 1 "$work/marked.log")"
    ffmpeg -v error -nostdin -y -i "$film/video.mkv" -vf "select='eq(n,0)+eq(n,132)'" -vsync 0 "$work/marked-%d.png"
    "$python" scripts/pictures.py markers "$film" "$work/marked-tree" "$work"/marked-{1,2}.png 132 "$to/markers.png"
    told "$to/markers.png"
}

# Figures 6, 7, 9 to 12 and 14 of Hu et al., and their Table 1, of made films and scans: a tree with ten markers that is pulled with a
# rope on its trunk, on one branch with two forces, and on another one; a second tree; a scan of the first with what a film of
# it told, and scans of both with the trees that space colonisation grows. In films with markers branches act back on what carries them.
hu() {
    local seed=53101 other=53102 name
    pulled all $seed
    pulled at-1 $seed --rope-at 1
    pulled at-1-half $seed --rope-at 1 --force 0.5
    pulled at-3 $seed --rope-at 3
    pulled other $other
    "$python" scripts/pictures.py angles "$to/hu-angles.png" \
        "branch 3|time|$(swing at-1 3)" "its spectrum|spectrum|$(swing at-1 3)" "branch 18, on branch 3|time|$(swing at-1 18)" \
        "its spectrum|spectrum|$(swing at-1 18)" "branch 1|time|$(swing at-1 1)" "its spectrum|spectrum|$(swing at-1 1)" \
        "branch 7, on branch 1|time|$(swing at-1 7)" "its spectrum|spectrum|$(swing at-1 7)"
    told "$to/hu-angles.png"
    "$python" scripts/pictures.py angles "$to/hu-spectra.png" \
        "branch 3, rope at three places|spectrum|$(swing at-1 3 "on branch 1"),$(swing at-3 3 "on branch 3"),$(swing all 3 "on the trunk")" \
        "branch 1, rope at three places|spectrum|$(swing at-1 1 "on branch 1"),$(swing at-3 1 "on branch 3"),$(swing all 1 "on the trunk")" \
        "one tree|spectrum|$(swing all 1 1),$(swing all 3 3),$(swing all 5 5),$(swing all 18 18)" \
        "another tree|spectrum|$(swing other 3 3),$(swing other 12 12),$(swing other 10 10),$(swing other 8 8)" \
        "trunk, two forces|spectrum|$(swing at-1 0 full),$(swing at-1-half 0 half)" \
        "branch 3, two forces|spectrum|$(swing at-1 3 full),$(swing at-1-half 3 half)" \
        "branch 18 of the third level|spectrum|$(swing at-1 18 "on branch 1"),$(swing at-3 18 "on branch 3"),$(swing all 18 "on the trunk")"
    told "$to/hu-spectra.png"
    for name in at-1-half at-1; do
        "$arborcam" analyze "$work/pulled-$name-tree" --markers --json >"$work/pulled-$name.json" 2>"$work/pulled.log" ||
            fail "analyze of $name failed: $(tail -n 1 "$work/pulled.log")"
    done
    "$python" scripts/pictures.py parameters "$work"/pulled-at-1-half{,.json} "$work"/pulled-at-1{,.json}
    scanned_beside $seed $other
}

# pulled NAME SEED OPTIONS...: a made film of ten markers on a tree that is pulled and released, and its capture.
pulled() {
    local name=$1 seed=$2 film=$work/pulled-$1
    shift 2
    "$python" benches/made_films.py "$work" "pulled-$name" "$seed" bare held --markers 10 --seconds 13.634 --acts-back 1.6 "$@" ||
        fail "no film with markers could be made; see the head of benches/made_films.py for what PYTHON needs"
    "$arborcam" replay "$film/video.mkv" --outline "$film/outline.json" --markers "$film/markers.json" --fast --headless \
        --out "$film-tree" 2>"$film.log" || fail "the replay of $name failed: $(tail -n 1 "$film.log")"
}

# swing NAME BRANCH [LABEL]: a curve for `pictures.py angles`.
swing() { printf '%s:%s:%s:%s' "$work/pulled-$1" "$work/pulled-$1-tree" "$2" "${3:-}"; }

# scanned_beside SEED OTHER: the first scan with the frequencies of a film, and both with their trees by space colonisation.
scanned_beside() {
    local seed film=$work/released
    "$python" benches/made_films.py "$work" released "$1" bare release || fail "no film could be made"
    "$arborcam" replay "$film/video.mkv" --outline "$film/outline.json" --fast --headless --out "$film-tree" 2>"$film.log" ||
        fail "the replay failed: $(tail -n 1 "$film.log")"
    for seed in "$@"; do
        "$python" benches/made_clouds.py "$work" "scan-$seed" "$seed" || fail "no cloud could be made; see the head of benches/made_clouds.py"
        cylinders "$seed" grown --method colonisation
        "$python" scripts/pictures.py fit "$work/scan-$seed/cloud.ply" "$work/scan-$seed-grown.csv" 330 "$work/fit-$seed.png"
    done
    row "$to/cloud-fit.png" "$work"/fit-{$1,$2}.png
    cylinders "$1" swaying --film "$film-tree"
    "$python" scripts/pictures.py swaying "$work/scan-$1/cloud.ply" "$work/scan-$1-swaying.csv" 360 "$to/cloud-film.png"
    told "$to/cloud-film.png"
}

# cylinders SEED NAME OPTIONS...: the table of cylinders of a scan's tree.
cylinders() {
    local scan=$work/scan-$1 name=$2
    shift 2
    "$arborcam" cloud "$scan/cloud.ply" --out "$scan-$name" "$@" 2>"$work/cloud.log" &&
        "$arborcam" export "$scan-$name" --format qsm --out "$scan-$name.csv" 2>"$work/cloud.log" ||
        fail "cloud failed: $(tail -n 1 "$work/cloud.log")"
}

# Forty trees of eight on a hill.
forest() {
    local tree=winter
    [[ -n $clips ]] && tree=oak
    capture "$tree"
    "$arborcam" grow "$work/$tree" --count 40 --forest --motion none --height-map docs/shapes/hills.png \
        --out "$work/forest" 2>"$work/grow.log" || fail "grow --forest failed: $(tail -n 1 "$work/grow.log")"
    "$arborcam" render "$work/forest" --view turntable --size 800x330 --out "$work/forest.png" 2>"$work/render.log" ||
        fail "render of the forest failed: $(cat "$work/render.log")"
    row "$to/forest.png" "$work/forest.png"
}

# render_made NAME [VIEW]: draws the tree in a folder below $work to made-NAME[-VIEW].png, slashes as dashes.
render_made() {
    "$arborcam" render "$work/$1" --bare --size 256x288 --view "${2:-front}" \
        --out "$work/made-${1//\//-}${2:+-$2}.png" 2>"$work/render.log" ||
        fail "render of $1 failed: $(cat "$work/render.log")"
}

# Still air, a breeze, a gale and a storm.
wind() {
    local tree force out
    for tree in "${trees[@]}"; do
        capture "$tree"
        for force in 0 4 7 10; do
            out=$work/$tree-wind-$force.png
            rm -f "$out"
            "$arborcam" animate "$work/$tree" --wind "$force" --seconds 3 --size 288x288 --out "$out" 2>"$work/animate.log" ||
                fail "animate --wind $force failed: $(tail -n 1 "$work/animate.log")"
        done
        row "$to/$tree-wind.png" "$work/$tree"-wind-{0,4,7,10}.png
    done
}

# What `cargo bench --bench wood` finds in the clip in folder $1, into folder $2.
find_wood() {
    if [[ -n ${WOOD:-} ]]; then
        "$WOOD" "$1" "$2"
    else
        cargo bench --locked --bench wood -- "$1" "$2"
    fi
}

# sheet NAME: of the clip in $work/clip-NAME.
sheet() {
    local name=$1 clip=$work/clip-$1 capture=$work/sheet-$1 view
    "$arborcam" replay "$clip/video.mkv" --outline "$clip/outline.json" --fast --headless --out "$capture" \
        2>"$capture.log" || fail "the replay of $name failed: $(tail -n 1 "$capture.log")"
    find_wood "$clip" "$work/wood-$name" >"$capture.wood" 2>&1 || fail "no wood of $name: $(tail -n 1 "$capture.wood")"
    for view in front side; do
        "$arborcam" render "$capture" --out "$work/sheet-$name-$view.png" --view $view --pose rest --size 640x360 \
            --background white 2>"$work/render.log" || fail "render --view $view failed: $(cat "$work/render.log")"
    done
    mkdir -p out
    "$python" scripts/pictures.py sheet "$work/wood-$name" "$capture" "$work/sheet-$name-front.png" \
        "$work/sheet-$name-side.png" "out/$name.png"
    printf 'pictures: out/%s.png, %s\n' "$name" "$(grep '^wood:' "$capture.wood" | tail -n 1)"
}

# Each clip on one sheet: is the tree in the model the tree in the film?
sheets() {
    local name
    if [[ -n $clips ]]; then
        for name in sparse_winter oak_release; do
            ln -s "$(realpath "$clips/$name")" "$work/clip-$name"
            sheet $name
        done
        return
    fi
    mkdir "$work/clip-sparse_winter"
    ln -s "$PWD/recordings/sparse_winter.mkv" "$work/clip-sparse_winter/video.mkv"
    ln -s "$PWD/recordings/sparse_winter.outline.json" "$work/clip-sparse_winter/outline.json"
    sheet sparse_winter
    "$python" benches/made_films.py "$work" clip-made_leaves 1 leaves release ||
        fail "no film could be made; see the head of benches/made_films.py for what PYTHON needs"
    sheet made_leaves
}

# A frame with outline and points, coloured by main branch.
points() {
    capture winter
    "$python" scripts/pictures.py points "$work/winter" "$to/frame.png"
    told "$to/frame.png"
}

# The screen of a running capture. A server of its own, lest it meets the user's sessions.
terminal() {
    local server=arborcam-pictures-$$ k
    tmux -L "$server" -f /dev/null new-session -d -x 120 -y 40 \
        "env TERM=tmux-256color COLORTERM=truecolor ARBORCAM_PREVIEW=halfblocks '$arborcam' replay '${film[winter]}' \
        --outline '${outline[winter]}' --out '$work/screen'; sleep 60"
    for ((k = 0; k < 60; k++)); do
        sleep 0.3
        tmux -L "$server" capture-pane -p | grep -q '±' && break
    done
    # Paused, so that the film does not end before the picture is taken.
    tmux -L "$server" send-keys Space m
    sleep 1
    tmux -L "$server" capture-pane -e -p >"$work/screen.txt"
    tmux -L "$server" kill-server
    "$python" scripts/pictures.py terminal "$work/screen.txt" "$to/terminal.png"
    told "$to/terminal.png"
}

# The page in a desktop's and a phone's browser.
page() {
    capture winter
    scripts/test-modules.sh >/dev/null
    "$arborcam" export "$work/winter" --format html --out "$work/page.html" 2>"$work/page.log" ||
        fail "the page was not written: $(cat "$work/page.log")"
    node scripts/pictures-viewer.mjs "$work/page.html" "$work/viewer.png" "$work/viewer-phone.png"
    row "$to/viewer.png" "$work/viewer.png"
    row "$to/viewer-phone.png" "$work/viewer-phone.png"
}

wanted views && views
wanted film && film_beside
wanted shapes && shapes
wanted wind && wind
wanted grown && grown
wanted sketch && sketch
wanted photo && photo
wanted cloud && cloud
wanted markers && markers
wanted hu && hu
wanted forest && forest
wanted points && points
wanted terminal && terminal
wanted page && page
wanted sheets && sheets
echo "pictures: $(du -ck "$to"/* | tail -n 1 | cut -f 1) kB in ${to#"$PWD/"}"
