{
  description = "Depth from two images, with the same bits on every device";

  inputs.nixpkgs.url = "github:NixOS/nixpkgs/nixos-unstable";

  outputs =
    { self, nixpkgs }:
    let
      inherit (nixpkgs) lib;
      package = (builtins.fromTOML (builtins.readFile ./Cargo.toml)).workspace.package;
      systems = [
        "x86_64-linux"
        "aarch64-linux"
        "x86_64-darwin"
        "aarch64-darwin"
      ];
      each = make: lib.genAttrs systems (system: make system nixpkgs.legacyPackages.${system});
    in
    {
      packages = each (
        system: pkgs: rec {
          default = mrfgs;
          mrfgs = pkgs.rustPlatform.buildRustPackage {
            pname = "mrfgs";
            inherit (package) version;
            src = self;
            cargoLock.lockFile = ./Cargo.lock;
            buildAndTestSubdir = "cli";
            buildFeatures = [ "live" ];
            # The tests take a driver and all processors; `checks` makes a map.
            doCheck = false;
            nativeBuildInputs = [ pkgs.installShellFiles ];
            postInstall = ''
              $out/bin/mrfgs man man
              installManPage man/*.1
              installShellCompletion --cmd mrfgs \
                --bash <($out/bin/mrfgs completions bash) \
                --zsh <($out/bin/mrfgs completions zsh) \
                --fish <($out/bin/mrfgs completions fish)
            '';
            # The program looks for the loader of Vulkan when it runs.
            postFixup = lib.optionalString pkgs.stdenv.hostPlatform.isLinux ''
              patchelf --add-rpath ${lib.makeLibraryPath [ pkgs.vulkan-loader ]} $out/bin/mrfgs
            '';
            meta = {
              description = "Depth from two images, with the same bits on every device";
              license = with lib.licenses; [
                mit
                asl20
              ];
              mainProgram = "mrfgs";
            };
          };
        }
      );

      checks = each (
        system: pkgs: {
          first-map = pkgs.runCommand "mrfgs-first-map" { } ''
            mkdir $out
            ${self.packages.${system}.mrfgs}/bin/mrfgs match --device cpu --max-disparity 47 \
              ${./testdata/mixed/im0.png} ${./testdata/mixed/im1.png} $out/disparity.pfm
          '';
        }
      );

      devShells = each (
        system: pkgs: {
          default = pkgs.mkShell {
            packages = [
              pkgs.cargo
              pkgs.clippy
              pkgs.nodejs
              pkgs.python3
              pkgs.rustc
              pkgs.rustfmt
            ];
            LD_LIBRARY_PATH = lib.optionalString pkgs.stdenv.hostPlatform.isLinux (lib.makeLibraryPath [ pkgs.vulkan-loader ]);
          };
        }
      );
    };
}
